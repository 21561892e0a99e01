"""Files that an archive had not kept, taken into restored folders from runs that were made again elsewhere."""

from pathlib import Path
from typing import NamedTuple

from mtcsirl.errors import UserError
from mtcsirl.files import storage
from mtcsirl.files.identity import NOTE, Record, checksum, not_kept, read_record
from mtcsirl.results.soundness import foreign


class Filled(NamedTuple):
    """What became of the files that restored folders lacked, as paths below the results."""

    taken: tuple[str, ...]
    other: tuple[str, ...]
    """Made again with other bytes, and left alone."""
    missing: tuple[str, ...]
    """Not made again."""


def fill(results: Path, again: Path) -> Filled:
    """Copy what restored folders below ``results`` lack from the same folders below ``again``, if the bytes are theirs.

    A run that was made again need not have the archive's bytes in every file, nor be finished: a file counts if its
    SHA-256 is the one that the restored run's identity has of it. So what has read the file stays as it is.

    Raises:
        UserError: ``again`` is no folder, or a restored run names files that its stage does not leave.
        HeldError: another process holds a folder that lacks a file.
    """
    if not again.is_dir():
        raise UserError(f"{again}: no such folder; name the results folder below which runs were made again")
    found: dict[str, list[str]] = {kind: [] for kind in Filled._fields}
    for note in sorted(results.rglob(NOTE)):
        folder = note.parent
        record = read_record(folder)
        if record is None:
            continue
        if strange := foreign(record):
            raise UserError(f"{folder / strange[0]}: no file that its stage leaves; delete {folder} and restore it")
        place = folder.relative_to(results)
        for name in _lacking(folder, record):
            became = _take(again / place / name, folder, name, record.files[name])
            found[became].append(str(place / name))
    return Filled(**{kind: tuple(paths) for kind, paths in found.items()})


def _lacking(folder: Path, record: Record) -> list[str]:
    absent = sorted(not_kept(folder, record) & set(record.files))
    return [name for name in absent if not (folder / name).is_file()]


def _take(source: Path, folder: Path, name: str, sha256: str) -> str:
    """Copy a file of these bytes into the run's folder under its name; what became of it."""
    if not source.is_file():
        return "missing"
    if checksum(source) != sha256:
        return "other"
    with storage.locked(folder):
        storage.write_bytes(folder / name, source.read_bytes())
    return "taken"
