"""Is every file of a results folder what its run wrote? `mtcsirl verify` says what to delete."""

import os
import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from mtcsirl.errors import UserError
from mtcsirl.files.identity import FILE, NOT_RESULTS, Record, checksum, lost, read_record, result_files
from mtcsirl.study.folders import holds_run, left_traces

KEPT_APART = ("logs", "artefacts", ".snakemake")
"""Folders below the results that hold no runs."""
_TEMPORARY = re.compile(r"\..+\.\d+\.tmp")


@dataclass(frozen=True)
class Fault:
    """A folder or file that cannot be trusted, and why."""

    path: Path
    why: str


def faults(results: Path) -> Iterator[Fault]:
    """Everything below ``results`` that is damaged, lost, unsigned or left behind.

    Raises:
        UserError: there is no such folder, or no run in it.
    """
    if not results.is_dir():
        raise UserError(f"{results}: no such folder")
    there = list(_files(results))
    signed = {path.parent for path in there if path.name == FILE and _is_ours(path.parent)}
    begun = {path.parent for path in there if path.name == "settings.json" and not _apart(path, results)} - signed
    unsigned = {folder for folder in begun if holds_run(folder)}
    left = sorted(path for path in there if _TEMPORARY.fullmatch(path.name))
    if not (signed or unsigned or left):
        raise UserError(f"{results}: holds no run; name the results folder of a study, or of one run")
    for folder in sorted(signed):
        yield from _of_folder(folder)
    for folder in sorted(unsigned):
        yield Fault(folder, f"holds results without {FILE}: its run never ended, or they come from elsewhere")
    for path in left:
        yield Fault(path, "left by a writer that was killed")


def _files(results: Path) -> Iterator[Path]:
    """Every file below ``results``, in linked folders too; what several links lead to once, so that circles end."""
    seen: set[str] = set()
    for folder, below, names in os.walk(results, followlinks=True):
        real = os.path.realpath(folder)
        if real in seen:
            below.clear()
            continue
        seen.add(real)
        yield from (Path(folder, name) for name in names)


def _is_ours(folder: Path) -> bool:
    """Whether the record in ``folder`` is a run's or an artefact's, damaged perhaps, and nobody else's file."""
    return left_traces(folder) or (folder / "provenance.json").is_file() or folder.parent.name == "artefacts"


def _of_folder(folder: Path) -> Iterator[Fault]:
    try:
        record = read_record(folder)
    except UserError as error:
        yield Fault(folder, str(error))
        return
    assert record is not None
    yield from _changed(folder, record)
    if folder.parent.name != "artefacts":
        foreign = set(result_files(folder)) - set(record.files) - set(NOT_RESULTS)
        for name in sorted(foreign):
            yield Fault(folder / name, "no file of its run; if it is yours, keep it elsewhere")


def _changed(folder: Path, record: Record) -> Iterator[Fault]:
    for name in lost(folder, record):
        yield Fault(folder, f"lost {name}")
    for name, wanted in record.files.items():
        path = folder / name
        if path.is_file() and checksum(path) != wanted:
            yield Fault(folder, f"{name} changed since its run wrote it")


def _apart(path: Path, results: Path) -> bool:
    return path.relative_to(results).parts[0] in KEPT_APART
