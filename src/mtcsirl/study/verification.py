"""Is every file of a results folder what its run wrote? `mtcsirl verify` says what to delete."""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from mtcsirl.errors import UserError
from mtcsirl.files.identity import FILE, NOT_RESULTS, Record, checksum, lost, read_record, result_files

KEPT_APART = ("logs", "artefacts", ".snakemake")
"""Folders below the results that hold no runs."""


@dataclass(frozen=True)
class Fault:
    """A folder or file that cannot be trusted, and why."""

    path: Path
    why: str


def faults(results: Path) -> Iterator[Fault]:
    """Everything below ``results`` that is damaged, lost, unsigned or left behind.

    Raises:
        UserError: there is no such folder.
    """
    if not results.is_dir():
        raise UserError(f"{results}: no such folder")
    signed: set[Path] = set()
    for path in sorted(results.rglob(FILE)):
        signed.add(path.parent)
        yield from _of_folder(path.parent)
    for path in sorted(results.rglob("settings.json")):
        if path.parent not in signed and not _apart(path, results):
            yield Fault(path.parent, f"holds results without {FILE}: its run never ended, or they come from elsewhere")
    for path in sorted(results.rglob(".*.tmp")):
        yield Fault(path, "left by a writer that was killed")


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
            yield Fault(folder / name, "no file of its run")


def _changed(folder: Path, record: Record) -> Iterator[Fault]:
    for name in lost(folder, record):
        yield Fault(folder, f"lost {name}")
    for name, wanted in record.files.items():
        path = folder / name
        if path.is_file() and checksum(path) != wanted:
            yield Fault(folder, f"{name} changed since its run wrote it")


def _apart(path: Path, results: Path) -> bool:
    return path.relative_to(results).parts[0] in KEPT_APART
