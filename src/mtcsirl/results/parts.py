"""The parts of an archive as they lie on the disk: their manifests, and frames whose columns are what they should be.

Nothing in a part is trusted: whoever can edit a frame can redo the manifest, too.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import pandas as pd
from pyarrow import ArrowException

from mtcsirl.errors import UserError
from mtcsirl.files import storage
from mtcsirl.files.identity import FILE
from mtcsirl.results.packing import BLOBS, FRAMES, INDEX, TEXTS, WEIGHTS

MANIFEST = "manifest.json"
FORMAT = "mtcsirl archive 1"
AGAIN = "get this part again from where the archive came from"
PART = re.compile(r"part-\d{4}", re.ASCII)
COLUMNS: Mapping[str, Mapping[str, type]] = {
    INDEX: {"folder": str, "file": str, "sha256": str, "kept": bool, "columns": str},
    TEXTS: {"folder": str, "file": str, "content": str},
    WEIGHTS: {"folder": str, "file": str, "exponents": bytes, "rest": bytes},
    BLOBS: {"folder": str, "file": str, "content": bytes},
}
"""Of the frames that hold files: each column and what is in its cells. The others are tidy, as their CSV files are."""
NUMBERS = ("target", "seed", "episode", "step", "value", "low", "high", "n", "episodes")
"""Columns of tidy frames that hold numbers."""


def parts(archive: Path) -> list[Path]:
    """The folders of the archive, in the order in which they were added."""
    return sorted(path for path in archive.glob("part-*") if PART.fullmatch(path.name) and path.is_dir())


def number_of(part: Path) -> int:
    """The number in a part's name."""
    return int(part.name.removeprefix("part-"))


def strangers(archive: Path) -> Iterator[str]:
    """What is lost or lies in the archive as if it were a part, so that other readers may count it; one line each."""
    found = {number_of(part) for part in parts(archive)}
    for number in sorted(set(range(1, max(found, default=0) + 1)) - found):
        yield f"{archive / f'part-{number:04d}'}: lost, or not a part"
    for path in sorted(archive.iterdir()):
        number = number_of(path) if PART.fullmatch(path.name) else 0
        if not (path.is_dir() and number) and _seems_a_part(path):
            yield f"{path}: no part of the archive, left by an `archive add` that ended early or by others; delete it"


def _seems_a_part(path: Path) -> bool:
    holds_frames = path.is_dir() and any(path.glob("*.parquet"))
    return path.name.lstrip(".").startswith("part-") or path.suffix == ".parquet" or holds_frames or path.name == FILE


def check(part: Path) -> None:
    """Hold every file of a part against its manifest.

    Raises:
        UserError: one was changed, lost or put there.
    """
    if (part.parent / FILE).exists():
        raise UserError(f"{part.parent / FILE}: no file of an archive, but of a run; move it out of there")
    said = _parsed(part / MANIFEST)
    if not isinstance(said, dict) or said.get("format") != FORMAT or not isinstance(said.get("files"), dict):
        raise UserError(f"{part / MANIFEST}: not the manifest of an archive; {AGAIN}")
    sums = said["files"]
    for name in sorted({*sums, *(path.name for path in part.iterdir())} - {MANIFEST}):
        path = part / name
        if name not in sums or Path(name).name != name or name.removesuffix(".parquet") not in FRAMES:
            raise UserError(f"{path}: no file of the archive, by its {MANIFEST}; {AGAIN}")
        if not path.is_file():
            raise UserError(f"{path}: lost; {AGAIN}")
        if storage.checksum(path) != sums[name]:
            raise UserError(f"{path}: changed since it was added; {AGAIN}")


def _parsed(path: Path) -> Any:
    if not path.is_file():
        raise UserError(f"{path}: lost; {AGAIN}")
    try:
        return storage.read_json(path)
    except UserError as error:
        raise UserError(f"{path}: not a readable JSON file; {AGAIN}") from error


def frames(part: Path) -> dict[str, pd.DataFrame]:
    """Every frame that the part has.

    Raises:
        UserError: one is no frame of an archive.
    """
    there = [name for name in FRAMES if (part / f"{name}.parquet").is_file()]
    return {name: frame(part, name) for name in dict.fromkeys((INDEX, TEXTS, *there))}


def frame(part: Path, name: str) -> pd.DataFrame:
    """One frame of a part.

    Raises:
        UserError: it is lost, unreadable, or has other columns or cells than it should.
    """
    path = part / f"{name}.parquet"
    if not path.is_file():
        raise UserError(f"{path}: lost; {AGAIN}")
    try:
        rows = storage.read_parquet(path)
    except UserError as error:
        raise UserError(f"{path}: not a readable Parquet file; {AGAIN}") from error
    try:
        faults = list(_faults_of_columns(name, rows))
    except (ValueError, ArrowException) as error:  # texts are only decoded when they are looked at
        raise UserError(f"{path}: not a readable Parquet file; {AGAIN}") from error
    for fault in faults:
        raise UserError(f"{path}: {fault}; {AGAIN}")
    return rows


def _faults_of_columns(name: str, rows: pd.DataFrame) -> Iterator[str]:
    wanted: Mapping[str, type] = COLUMNS.get(name, {"folder": str})
    for column, kind in wanted.items():
        if column not in rows.columns:
            yield f"lacks the column {column}"
        elif not rows[column].map(lambda cell, kind=kind: isinstance(cell, kind)).all():
            yield f"column {column} holds a cell that is no {kind.__name__}"
    if name in COLUMNS:
        yield from (f"column {column!r} does not belong there" for column in rows.columns if column not in wanted)
        return
    for column in [column for column in NUMBERS if column in rows.columns]:
        if not pd.api.types.is_numeric_dtype(rows[column]):
            yield f"column {column} holds what is no number"
