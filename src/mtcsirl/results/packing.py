"""What of a run goes into which frame of the archive, and how its files come back out of them, byte for byte."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from io import StringIO
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from mtcsirl.errors import UserError
from mtcsirl.files import storage
from mtcsirl.files.identity import FILE, Record, digest_of

PROVENANCE = "provenance.json"
CSVS = {"evaluation.csv": "evaluation", "curve.csv": "curve", "scores.csv": "scores"}
"""Kept whole, as tidy frames."""
POINTS = "points.parquet"
THINNED = "diagnostics.csv"
EVERY = 10
"""Of an IRL run's diagnostics each so many iterations are kept, and the last."""
NOT_KEPT = ("samples.parquet", "demonstrations.parquet", THINNED)
"""Files that can only be made again."""
INDEX, TEXTS, WEIGHTS, BLOBS, DIAGNOSTICS = "files", "texts", "weights", "points", "diagnostics"
FRAMES = (INDEX, TEXTS, WEIGHTS, BLOBS, *CSVS.values(), DIAGNOSTICS)
"""``files``: one row per file of a run; ``texts``, ``weights``, ``points``: contents; the others are tidy."""

Frames = Mapping[str, pd.DataFrame]


def kept(name: str, policies: bool) -> bool:
    """Whether the archive keeps a file so that it comes back; of policies' weights only where ``policies``."""
    is_policy = name.startswith(("policy.", "policies/")) and name.endswith(".safetensors")
    return name not in NOT_KEPT and (policies or not is_policy)


def packed(source: Path, folder: str, record: Record, policies: bool) -> Iterator[tuple[str, pd.DataFrame]]:
    """The rows of the run in ``source`` by the frame that they belong to, its ``folder`` in the first column.

    Raises:
        UserError: a file is not what the run wrote, or of a kind that the archive does not know.
    """
    for name in (*record.files, FILE, PROVENANCE):
        path = source / name
        keeps, columns = kept(name, policies), ""
        if name in CSVS or name == THINNED:
            frame = storage.read_csv(path)
            columns = ",".join(frame.columns)
            yield CSVS.get(name, DIAGNOSTICS), _row(folder, frame if keeps else _thinned(frame))
        elif keeps:
            yield _content(path, folder, name)
        sha = record.files.get(name) or digest_of(storage.read_bytes(path))
        yield INDEX, _row(folder, {"file": name, "sha256": sha, "kept": keeps, "columns": columns})


def _content(path: Path, folder: str, name: str) -> tuple[str, pd.DataFrame]:
    content = storage.read_bytes(path)
    if name == POINTS:
        return BLOBS, _row(folder, {"file": name, "content": content})
    if name.endswith(".safetensors") and not len(content) % 4:
        exponents, rest = split(content)
        return WEIGHTS, _row(folder, {"file": name, "exponents": exponents, "rest": rest})
    if name.endswith(".json"):
        return TEXTS, _row(folder, {"file": name, "content": content.decode()})
    raise UserError(f"{path}: no kind of file that the archive knows")


def _row(folder: str, row: pd.DataFrame | Mapping[str, Any]) -> pd.DataFrame:
    frame = row if isinstance(row, pd.DataFrame) else pd.DataFrame([row])
    frame.insert(0, "folder", folder)
    return frame


def _thinned(frame: pd.DataFrame) -> pd.DataFrame:
    steps = np.sort(frame["step"].unique())
    return frame[frame["step"].isin([*steps[EVERY - 1 :: EVERY], *steps[-1:]])].copy()


def split(content: bytes) -> tuple[bytes, bytes]:
    """Float32 as their exponents, which are alike and compress, and the three bytes that do not.

    Each word is turned left by one bit, so that its first byte is the exponent and the sign stands last.
    """
    words = np.frombuffer(content, "<u4")
    planes = (words << np.uint32(1) | words >> np.uint32(31)).view("u1").reshape(-1, 4)
    return planes[:, 3].tobytes(), planes[:, :3].tobytes()


def joined(exponents: bytes, rest: bytes) -> bytes:
    """What ``split`` took apart."""
    first, others = np.frombuffer(exponents, "u1"), np.frombuffer(rest, "u1").reshape(-1, 3)
    words = np.column_stack([others, first]).view("<u4").ravel()
    return (words >> np.uint32(1) | words << np.uint32(31)).tobytes()


def by_folder(frames: Frames) -> dict[str, dict[str, pd.DataFrame]]:
    """Folder -> frame -> its rows."""
    found: dict[str, dict[str, pd.DataFrame]] = {}
    for name, frame in frames.items():
        for folder, rows in frame.groupby("folder", sort=False, observed=True):
            found.setdefault(str(folder), {})[name] = rows.drop(columns="folder")
    return found


def unpacked(own: Frames) -> dict[str, bytes]:
    """Every kept file of one run by its name, from its own rows."""
    files = {}
    for name, columns, keeps in own[INDEX][["file", "columns", "kept"]].itertuples(index=False):
        if keeps and name in CSVS:
            files[name] = rendered(own.get(CSVS[name], pd.DataFrame()), columns.split(","))
    for frame in (TEXTS, BLOBS):
        if frame in own:
            files |= {name: _bytes(content) for name, content in own[frame].itertuples(index=False)}
    if WEIGHTS in own:
        files |= {name: joined(first, rest) for name, first, rest in own[WEIGHTS].itertuples(index=False)}
    return files


def _bytes(content: str | bytes) -> bytes:
    return content.encode() if isinstance(content, str) else bytes(content)


def rendered(frame: pd.DataFrame, columns: list[str]) -> bytes:
    """Rows as the bytes that :func:`mtcsirl.files.storage.write_csv` writes."""
    text = StringIO()
    storage.render_csv(text, frame.reindex(columns=columns))
    return text.getvalue().encode()
