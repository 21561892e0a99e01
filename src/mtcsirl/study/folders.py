"""Whose a folder is: a stage fills one that is new or empty, or where the same run stands or was begun.

What else is in a folder belongs to somebody: it is neither replaced nor signed.
"""

import re
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, NamedTuple

from mtcsirl.errors import UserError
from mtcsirl.files import storage
from mtcsirl.files.fingerprint import digest
from mtcsirl.files.identity import CHECKPOINT, FILE, NOT_RESULTS, NOTE, read_record, result_files
from mtcsirl.study.outputs import FOLDERS, OUTPUTS

BEGUN = ".begun"
"""Which run is being made here; goes when the run is signed."""
_OURS = re.compile(r"\.begun|\.lock|\.[0-9a-f]{16}\.made|\..+\.tmp|\.nfs.*|\.snakemake.*|checkpoint.*|.*\.log|events")
"""What a run may have in its folder beside its results."""
_ALSO_OF_VERBS = {"curve.csv", "diagnostics.csv", "evaluation.csv"}
"""Files of runs whose names `validate`, `diagnostics` and `evaluate` give to their own as well."""


class Named(NamedTuple):
    """A run by its stage and key."""

    stage: str
    key: Mapping[str, Any]

    def __str__(self) -> str:
        """In words."""
        return f"{self.stage} ({', '.join(f'{name} {value}' for name, value in sorted(self.key.items()))})"


def begin(folder: Path, run: Named) -> None:
    """Note that ``run`` is made in ``folder``; it may be killed before its record stands there."""
    storage.write_json(folder / BEGUN, run._asdict())


def results_of(folder: Path, stage: str) -> list[str]:
    """The result files of ``stage`` below ``folder``: what its record signs."""
    own = {*OUTPUTS[stage]} - {*NOT_RESULTS}
    places = FOLDERS.get(stage, ())
    return [name for name in result_files(folder) if name in own or name.startswith(places)]


def check_folder(folder: Path, stage: str, key: Mapping[str, Any] | None = None) -> None:
    """Find out before any work whether ``stage`` may fill ``folder`` with the run of this ``key`` (None: any).

    Raises:
        UserError: another run is there, or files that are of no run.
    """
    names = _names(folder)
    own = {*OUTPUTS[stage], FILE, NOTE, *(place.rstrip("/") for place in FOLDERS.get(stage, ()))}
    _refuse_others(folder, names, own)
    _refuse_other_key(folder, names, stage, key)
    strangers = [name for name in names if name not in own and not _OURS.fullmatch(name)]
    if strangers and not left_traces(folder):
        raise UserError(f"{folder}: holds {strangers[0]}, which is of no run; name a new or an empty folder")
    left = [name for name in names if name in own and name != FILE]
    if left and not holds_run(folder):
        raise UserError(f"{folder}: holds {left[0]}, but no run that wrote it; name a new or an empty folder")


def check_without_run(folder: Path) -> None:
    """Find out before any work whether a verb that makes no run may write into ``folder``.

    Raises:
        UserError: a run stands there or was begun there, or in the folder above.
    """
    _refuse_others(folder, _names(folder), _ALSO_OF_VERBS)
    above = folder.absolute().parent
    found = [folder] if left_traces(folder) else [above] if next(_runs_in(above), None) else []
    if found:
        raise UserError(f"{folder}: a run stands or was begun in {found[0]}; choose a folder of its own")


def check_outside_runs(file: Path) -> None:
    """Find out before any work whether a verb may write this one ``file``: it would replace a run's own, or join them.

    Raises:
        UserError: a run stands or was begun in its folder, or stands in the folder above.
    """
    folder = file.absolute().parent
    replaced = file.is_file() and any(file.name in outputs for outputs in OUTPUTS.values())
    if replaced or holds_run(folder) or next(_runs_in(folder.parent), None):
        raise UserError(f"{file}: a run's folder; choose a place outside of it")


def holds_run(folder: Path) -> bool:
    """Whether a run stands in ``folder`` or was begun there, of this version or an older one."""
    return left_traces(folder) or any((folder / name).is_file() for name in (FILE, "provenance.json"))


def left_traces(folder: Path) -> bool:
    """Whether what only a run leaves is in ``folder``: nobody else has files of these names."""
    if any((folder / name).is_file() for name in (NOTE, CHECKPOINT, BEGUN)) or any(folder.glob(".*.made")):
        return True
    try:
        return read_record(folder) is not None
    except UserError:
        return False


def _names(folder: Path) -> list[str]:
    return sorted(entry.name for entry in folder.iterdir()) if folder.is_dir() else []


def _refuse_others(folder: Path, names: list[str], own: set[str]) -> None:
    others = {name for outputs in OUTPUTS.values() for name in outputs} - own
    found = [name for name in names if name in others]
    if found:
        raise UserError(f"{folder}: holds another run ({found[0]}); choose a folder of its own")


def _refuse_other_key(folder: Path, names: list[str], stage: str, key: Mapping[str, Any] | None) -> None:
    """A run that was begun and has left nothing yet is none: who mistyped a seed starts again at once."""
    left = CHECKPOINT in names or any(name in names for name in OUTPUTS[stage])
    for found in _runs_in(folder) if left else ():
        if found.stage != stage or (key is not None and digest(dict(found.key)) != digest(dict(key))):
            raise UserError(f"{folder}: holds another run, {found}; choose a folder of its own, or delete this one")


def _runs_in(folder: Path) -> Iterator[Named]:
    """The run whose record is in ``folder``, and the one that was begun there."""
    try:
        record = read_record(folder)
        if record is not None:
            yield Named(record.identity.stage, record.identity.key)
    except UserError:
        pass  # a damaged record says nothing; its run is made again
    try:
        said = storage.read_json(folder / BEGUN)
        yield Named(str(said["stage"]), dict(said["key"]))
    except (UserError, KeyError, TypeError, ValueError):
        pass
