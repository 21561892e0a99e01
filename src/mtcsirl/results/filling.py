"""Files that an archive had not kept, taken into restored folders from runs that were made again elsewhere."""

from collections.abc import Iterable
from pathlib import Path
from typing import NamedTuple

from mtcsirl.errors import UserError
from mtcsirl.files import storage
from mtcsirl.files.identity import NOTE, checksum, not_kept, read_record
from mtcsirl.results.soundness import foreign


class Filled(NamedTuple):
    """What became of the files that restored folders lacked, as paths below the results."""

    taken: tuple[str, ...]
    left: tuple[tuple[str, str], ...]
    """Files or folders that were left alone, and why."""
    missing: tuple[str, ...]
    """Not made again."""


def fill(results: Path, again: Path, folders: Iterable[str]) -> Filled:
    """Copy what restored ``folders`` below ``results`` lack from those below ``again``, if the bytes are theirs.

    A run that was made again need not have the archive's bytes in every file, nor be finished: a file counts if its
    SHA-256 is the one that the restored run's identity has of it. So what has read the file stays as it is.

    Raises:
        UserError: one of the two is no folder.
    """
    for one, what in ((results, "below which runs were restored"), (again, "below which runs were made again")):
        if not one.is_dir():
            raise UserError(f"{one}: no such folder; name the results folder {what}")
    taken: list[str] = []
    left: list[tuple[str, str]] = []
    missing: list[str] = []
    for folder in folders:
        try:
            absent = _lacking(results / folder)
            for name, sha256 in absent.items():
                path, source = f"{folder}/{name}", again / folder / name
                if not source.is_file():
                    missing.append(path)
                elif checksum(source) != sha256:
                    left.append((path, "other bytes than the archive's"))
                else:
                    _copy(source, results / folder, name)
                    taken.append(path)
        except UserError as error:
            left.append((folder, str(error)))
    return Filled(tuple(taken), tuple(left), tuple(missing))


def only_restored(again: Path, paths: Iterable[str]) -> list[str]:
    """Of files that were not made again those whose folders were restored below ``again`` too."""
    return [path for path in paths if any((again / parent / NOTE).is_file() for parent in Path(path).parents[:2])]


def _lacking(folder: Path) -> dict[str, str]:
    """SHA-256 of each file that a restored folder lacks; nothing of other folders.

    Raises:
        UserError: its record is damaged, or names what a run of its stage does not leave.
    """
    record = read_record(folder) if (folder / NOTE).is_file() else None
    if record is None:
        return {}
    if strange := foreign(record):
        raise UserError(f"{strange[0]!r} is no file that its stage leaves; delete {folder} and restore it")
    names = sorted(not_kept(folder, record) & set(record.files))
    return {name: record.files[name] for name in names if not (folder / name).is_file()}


def _copy(source: Path, folder: Path, name: str) -> None:
    with storage.locked(folder):
        storage.write_bytes(folder / name, source.read_bytes())
