"""How far a study is, read from its results folder while it runs or after: `mtcsirl status`."""

import time
from collections import Counter, defaultdict
from dataclasses import dataclass
from pathlib import Path

from mtcsirl.errors import UserError
from mtcsirl.files import storage
from mtcsirl.settings import Settings
from mtcsirl.study.keys import identity_of
from mtcsirl.study.outputs import OUTPUTS
from mtcsirl.study.plan import cost
from mtcsirl.study.rates import Rates
from mtcsirl.study.readings import gate_of, provenance_of
from mtcsirl.study.runs import AnyRun, Runs
from mtcsirl.study.screen import first_of, last_said, short
from mtcsirl.study.standing import DONE, INCOMPLETE, STALE, Standing, own_reasons, standing

RUNNING, FAILED, WAITING = "running", "failed", "waiting"
STATES = (DONE, STALE, RUNNING, FAILED, WAITING)
"""Stale: its number could differ today. Failed: was started, does not run and left no complete result."""
STARTING_SECONDS = 15
"""A log this young without a lock is a job that still imports its libraries."""

TOP = 2
"""Reasons that :func:`before_it_starts` names."""


@dataclass(frozen=True)
class RunStatus:
    """One run: its state, its gate (None: not done, or has none), its CPU seconds, what there is to say of it."""

    run: AnyRun
    state: str
    passed: bool | None = None
    seconds: float | None = None
    says: str = ""


def study_status(study: Runs, settings: Settings) -> list[RunStatus]:
    """The status of every run of ``study``, in the DAG's order."""
    return [run_status(run, settings) for run in study]


def run_status(run: AnyRun, settings: Settings) -> RunStatus:
    """Look into the folder of ``run`` and its log."""
    results = Path(settings.results)
    log = results / "logs" / run.folder / f"{identity_of(run, settings).hash}.log"
    if storage.is_locked(results / run.folder):
        return RunStatus(run, RUNNING, says=last_said(log))
    found = standing(run, settings)
    if found.state == DONE:
        return _finished(run, settings)
    if found.state == INCOMPLETE:
        return RunStatus(run, FAILED, says="; ".join(found.why))
    if log.is_file() and not _of_the_last_run(log, found):
        starting = time.time() - log.stat().st_mtime < STARTING_SECONDS
        if starting or log.stat().st_size:  # `snakemake --touch` leaves empty logs
            return RunStatus(run, RUNNING if starting else FAILED, says=last_said(log))
    return RunStatus(run, STALE if found.state == STALE else WAITING, says=first_of(own_reasons(found.why)))


def _of_the_last_run(log: Path, found: Standing) -> bool:
    """Whether a log is that of the run whose record stands there, made from what its inputs were then."""
    return found.state == STALE and found.record is not None and log.stem == found.record.identity.hash


def before_it_starts(study: Runs, settings: Settings) -> str:
    """One line: how many runs are done, stale and why, or half there, before a workflow starts."""
    found = [standing(run, settings) for run in study]
    counts = Counter(one.state for one in found)
    said = [f"{counts[DONE]} done"] + [f"{counts[state]} {state}" for state in (STALE, INCOMPLETE) if counts[state]]
    reasons = [why for one in found if one.state == STALE for why in _by_itself(one.why)]
    top = Counter(short(why, 60) for why in reasons).most_common(TOP)
    because = f" ({'; '.join(f'{count} x {why}' for why, count in top)})" if top else ""
    return f"{settings.results}: of {len(found)} runs {', '.join(said)}{because}"


def _by_itself(why: tuple[str, ...]) -> list[str]:
    """The reasons of a stale run, of its inputs in few words and once."""
    own = own_reasons(why)
    return ["an input is another"] if own[:1] and own[0].startswith("input ") else own


def seconds_left(statuses: list[RunStatus], settings: Settings, rates: Rates, cores: int) -> float:
    """Seconds of undisturbed cores for what is not done: as planned, times what the stage's done runs took of it.

    The mean of the done runs would take those to come for runs of their size: rewards of one task are learned first.
    """
    planned, took, left = (defaultdict[str, float](float) for _ in range(3))
    for status in statuses:
        stage, seconds = status.run.stage, cost(status.run, settings, rates).seconds
        if status.state != DONE:
            left[stage] += seconds
        elif status.seconds is not None:
            planned[stage] += seconds
            took[stage] += status.seconds
    pace = {stage: took[stage] / planned[stage] if planned[stage] else rates.slowdown for stage in left}
    return sum(pace[stage] * seconds for stage, seconds in left.items()) / cores


def _finished(run: AnyRun, settings: Settings) -> RunStatus:
    try:
        seconds = provenance_of(run, settings).number("cost", "cpu_seconds")
        passed = gate_of(run, settings).flag("passed") if "gate.json" in OUTPUTS[run.stage] else None
        return RunStatus(run, DONE, passed, seconds)
    except UserError as error:
        return RunStatus(run, FAILED, says=str(error))
