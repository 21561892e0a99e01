"""Which runs the page may speak of, and what each says of itself; the others are counted, with the way out."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

from mtcsirl.errors import MissingError, UserError
from mtcsirl.files.identity import REMAKE
from mtcsirl.settings import Settings
from mtcsirl.study.outputs import OUTPUTS
from mtcsirl.study.readings import Reading, gate_of, provenance_of
from mtcsirl.study.runs import AnyRun, Runs
from mtcsirl.study.screen import first_of
from mtcsirl.study.standing import ABSENT, DONE, STALE, Standing, own_reasons, standing

MISSING, DAMAGED = "missing", "damaged"
WAYS_OUT = {
    STALE: "`mtcsirl status` names each, snakemake makes it again",
    DAMAGED: "delete the folder of each and make it again (`mtcsirl verify` looks at every file)",
}


class Gate(NamedTuple):
    """Whether the agent of one task passed; success and metric are None where they were no numbers."""

    task: str
    passed: bool
    success: float | None
    metric: float | None


@dataclass(frozen=True)
class Told:
    """Provenance and gates of one run."""

    commit: str
    machine: str
    versions: Mapping[str, str]
    cpu_seconds: float
    peak_memory_mib: float
    gates: tuple[Gate, ...]


@dataclass(frozen=True)
class RunsThere:
    """The runs that are done. ``cautions``: one line for all that are stale, one for all that are damaged."""

    told: Mapping[AnyRun, Told]
    """Of those that are done and undamaged."""
    done: Mapping[str, str]
    """As :func:`mtcsirl.study.partial.done_runs`."""
    cautions: tuple[str, ...]


def runs_there(study: Runs, settings: Settings, *, partial: bool) -> RunsThere:
    """Look at every run of ``study``.

    Raises:
        MissingError: one is not done, or damaged, and ``partial`` is false.
    """
    told: dict[AnyRun, Told] = {}
    done: dict[str, str] = {}
    others: dict[str, list[str]] = {STALE: [], DAMAGED: []}
    for run in study:
        found = standing(run, settings)
        state, why = _seen(found)
        if found.state == DONE and found.record is not None:
            done[run.folder] = found.record.bytes
            try:
                told[run] = _tell(run, settings)
                continue
            except UserError as error:
                state, why = DAMAGED, str(error)
        if not partial:
            raise MissingError(f"{Path(settings.results) / run.folder}: this run is {state}" + (why and f" ({why})"))
        if state in others:
            others[state].append(f"{run.folder}: {why.removesuffix(f'; {REMAKE}')}")
    return RunsThere(told, done, tuple(_caution(*item) for item in others.items() if item[1]))


def _seen(found: Standing) -> tuple[str, str]:
    """The state of a run in the page's words, and why."""
    if found.state == STALE:
        return STALE, first_of(own_reasons(found.why))
    return MISSING if found.state == ABSENT else DAMAGED, "; ".join(found.why)


def _caution(state: str, found: list[str]) -> str:
    count = f"1 run is {state} and" if len(found) == 1 else f"{len(found)} runs are {state} and"
    first = "" if len(found) == 1 else "first "
    return f"{count} left out ({first}{found[0]}): {WAYS_OUT[state]}."


def _tell(run: AnyRun, settings: Settings) -> Told:
    """What a run that is done says of itself; raises UserError where that is unreadable or another thing."""
    said = provenance_of(run, settings)
    return Told(
        commit=said.text("commit"),
        machine=_machine(said),
        versions=said.texts("versions"),
        cpu_seconds=said.number("cost", "cpu_seconds"),
        peak_memory_mib=said.number("cost", "peak_memory_mib"),
        gates=_gates(run, settings) if "gate.json" in OUTPUTS[run.stage] else (),
    )


def _machine(said: Reading) -> str:
    processor, cores, system, python = (said.text("machine", name) for name in MACHINE)
    return f"{processor}, {cores} cores, {system}, Python {python}"


MACHINE = ("processor", "cores", "system", "python")


def _gates(run: AnyRun, settings: Settings) -> tuple[Gate, ...]:
    """One per agent; an IRL run has one per generator."""
    said = gate_of(run, settings)
    if isinstance(said.data, dict) and "members" in said.data:
        return tuple(_gate(own, own.text("task")) for own in said.parts("members"))
    return (_gate(said, str(run.key["task"])),)


def _gate(said: Reading, task: str) -> Gate:
    return Gate(task, said.flag("passed"), said.number_or_none("success"), said.number_or_none("metric"))
