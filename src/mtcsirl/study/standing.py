"""How a run of the study stands: absent, incomplete, stale (and why) or done. One answer for everyone who asks."""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from mtcsirl.errors import UserError
from mtcsirl.files import storage
from mtcsirl.files.identity import CHECKPOINT, Identity, Record, differences, lost, marker, read_record, write_marker
from mtcsirl.settings import Settings
from mtcsirl.study.keys import Run, identity_of

ABSENT, INCOMPLETE, STALE, DONE = "absent", "incomplete", "stale", "done"


@dataclass(frozen=True)
class Standing:
    """The state of a run's folder and, where it is not done, why; one line each."""

    state: str
    why: tuple[str, ...] = ()
    record: Record | None = None


def standing(run: Run[Any], settings: Settings, results: Path | str | None = None) -> Standing:
    """Hold the record in the folder of ``run`` against what ``settings`` and today's code ask for."""
    results = Path(settings.results if results is None else results)
    found = of_folder(results / run.folder, lambda: identity_of(run, settings))
    return found if found.state != DONE or found.record is None else _over_its_inputs(run, found.record, results)


def of_folder(folder: Path, identity: Callable[[], Identity]) -> Standing:
    """What stands in ``folder``, without a look at its inputs; ``identity``, asked where a record is: what should."""
    try:
        record = read_record(folder)
    except UserError as error:
        return Standing(INCOMPLETE, (str(error),))
    if record is None:
        return Standing(ABSENT)
    wanted = identity()
    if record.identity.hash != wanted.hash:
        return Standing(STALE, tuple(differences(record.identity, wanted)), record)
    missing = lost(folder, record)
    if missing:
        return Standing(INCOMPLETE, (f"lost {', '.join(missing)}",), record)
    return Standing(DONE, (), record)


def _over_its_inputs(run: Run[Any], record: Record, results: Path) -> Standing:
    """A run of the same identity may have been made again elsewhere, with other bytes."""
    for role, needed in run.needs.items():
        try:
            other = read_record(results / needed.folder)
        except UserError:
            continue
        if other is not None and role in record.read and record.read[role] != other.bytes:
            return Standing(STALE, (f"input {role}: made again with other bytes",), record)
    return Standing(DONE, (), record)


def own_reasons(why: Iterable[str]) -> list[str]:
    """Of the reasons why something is stale those of its own: an input is another only because its run is."""
    reasons = list(why)
    return [reason for reason in reasons if not reason.startswith("input ")] or reasons


def settle(runs: Iterable[Run[Any]], settings: Settings, *, mark: bool = True) -> dict[str, str]:
    """Leave in every folder the marker of what stands there; returns the hash that each run must have, by folder.

    Markers are a workflow's view: rewritten from the records each time it is read, whatever happened in between; and a
    run that is done needs no checkpoint, which one killed in its last moment still has.
    Without ``mark`` nothing is touched: a job that reads the workflow would take away what another has just left.
    """
    wanted: dict[str, str] = {}
    for run in runs:
        wanted[run.folder] = identity_of(run, settings).hash
        folder = Path(settings.results) / run.folder
        if mark and folder.is_dir():
            done = standing(run, settings).state == DONE
            write_marker(folder, wanted[run.folder] if done else None)
            if done:
                storage.remove(folder / CHECKPOINT)
    return wanted


def over_unfinished(runs: Iterable[Run[Any]], hashes: Mapping[str, str], results: Path | str) -> frozenset[str]:
    """The folders of the runs that are done although one that they were made from is not, by their markers.

    Where Snakemake has to make the lower one it takes all above it for asked for, comes no further than the run that
    is done, since markers are `ancient`, and so forgets what is missing above that (its issue 4166). A run that is done
    therefore asks for nothing then.
    """
    over: dict[str, bool] = {}

    def done(run: Run[Any]) -> bool:
        return (Path(results) / run.folder / marker(hashes[run.folder])).exists()

    def unfinished_below(run: Run[Any]) -> bool:
        if run.folder not in over:
            over[run.folder] = any(unfinished_below(needed) or not done(needed) for needed in run.needs.values())
        return over[run.folder]

    return frozenset([run.folder for run in runs if unfinished_below(run) and done(run)])
