"""The evidence archive: what a third party needs to check every number without training, in parts that are only added.

A part is a folder ``part-0001`` of Parquet files and a manifest with their SHA-256; no part is ever written again. Tidy
frames (``evaluation``, ``curve``, ``scores``, ``points``, ``diagnostics``) are to be read in pandas, with the run's
folder in the first column; ``texts`` holds identities, provenance, settings, gates and descriptions as they are, and
``weights`` the learned rewards and the policies that others were made from. Out of these every kept file comes back
byte for byte, as the checksums in its run's identity say; what is not kept is named there all the same.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from io import StringIO
from pathlib import Path

import numpy as np
import pandas as pd

from mtcsirl.errors import UserError
from mtcsirl.files import storage
from mtcsirl.files.identity import FILE, Record, checksum, digest_of, parse_record

CSVS = {"evaluation.csv": "evaluation", "curve.csv": "curve", "scores.csv": "scores"}
"""Kept whole, as tidy frames."""
THINNED = "diagnostics.csv"
EVERY = 10
"""Of an IRL run's diagnostics each so many iterations are kept."""
WEIGHTS = (".safetensors",)
NOT_KEPT = ("samples.parquet", "demonstrations.parquet", THINNED)
"""Files of runs that can only be made again; diagnostics are kept in part."""
MANIFEST = "manifest.json"
FRAMES = ("texts", "weights", "points", *CSVS.values(), "diagnostics")
PROVENANCE = "provenance.json"


@dataclass(frozen=True)
class Archived:
    """One run in the archive."""

    folder: str
    part: str
    record: Record


def parts(archive: Path) -> list[Path]:
    """The folders of the archive, in the order in which they were added."""
    return sorted(path for path in archive.glob("part-*") if path.is_dir())


def archived(archive: Path) -> dict[str, Archived]:
    """The runs of the archive by their folder; of a run that was added twice, the last."""
    found: dict[str, Archived] = {}
    for part in parts(archive):
        texts = _frame(part, "texts")
        for folder, text in texts.loc[texts["name"] == FILE, ["folder", "content"]].itertuples(index=False):
            found[folder] = Archived(folder, part.name, parse_record(text, f"{part}/texts.parquet: {folder}"))
    return found


def add(archive: Path, results: Path, folders: Iterable[str], with_policies: Iterable[str]) -> Path | None:
    """Add finished runs that the archive lacks as a new part; returns it, or None if there is nothing to add.

    ``with_policies``: folders whose policies are kept too.

    Raises:
        UserError: a run is not what its record says.
    """
    known, policies = archived(archive), set(with_policies)
    rows: dict[str, list[pd.DataFrame]] = {name: [] for name in FRAMES}
    added = 0
    for folder in folders:
        record = parse_record(storage.read_text(results / folder / FILE), str(results / folder / FILE))
        old = known.get(folder)
        if old is not None and old.record == record:
            continue
        for name, frame in _rows(results / folder, folder, record, folder in policies):
            rows[name].append(frame)
        added += 1
    if not added:
        return None
    part = archive / f"part-{len(parts(archive)) + 1:04d}"
    for name, frames in rows.items():
        if frames:
            _write(part / f"{name}.parquet", pd.concat(frames, ignore_index=True))
    storage.write_json(part / MANIFEST, {path.name: checksum(path) for path in sorted(part.glob("*.parquet"))})
    return part


def _rows(source: Path, folder: str, record: Record, policies: bool) -> Iterator[tuple[str, pd.DataFrame]]:
    """What of one run goes into which frame."""
    for name in (*record.files, FILE, PROVENANCE):
        path = source / name
        if name in CSVS:
            frame = storage.read_csv(path)
            if rendered(frame) != path.read_bytes():
                raise UserError(f"{path}: would not come back byte for byte; it is no file of this suite's")
            yield CSVS[name], _keyed(frame, folder)
        elif name == THINNED:
            yield "diagnostics", _keyed(_thinned(storage.read_csv(path)), folder)
        elif name == "points.parquet":
            yield "points", _keyed(storage.read_parquet(path), folder)
        elif name.endswith(WEIGHTS):
            if policies or not _is_policy(name):
                content = [_shuffled(storage.read_bytes(path))]
                yield "weights", pd.DataFrame({"folder": folder, "name": [name], "content": content})
        elif name not in NOT_KEPT:
            yield "texts", pd.DataFrame({"folder": folder, "name": [name], "content": [storage.read_text(path)]})


def _is_policy(name: str) -> bool:
    return name.startswith(("policy.", "policies/"))


def _keyed(frame: pd.DataFrame, folder: str) -> pd.DataFrame:
    frame.insert(0, "folder", folder)
    return frame


def _thinned(frame: pd.DataFrame) -> pd.DataFrame:
    steps = np.sort(frame["step"].unique())
    return frame[frame["step"].isin([*steps[EVERY - 1 :: EVERY], *steps[-1:]])]


def rendered(frame: pd.DataFrame) -> bytes:
    """A frame as the bytes that :func:`mtcsirl.files.storage.write_csv` writes."""
    text = StringIO()
    storage.render_csv(text, frame)
    return text.getvalue().encode()


def unpack(archive: Path, results: Path, folders: Iterable[str] | None = None) -> int:
    """Restore runs below ``results``, so that a workflow goes on from them; returns how many.

    A run that is there already is left alone. What was not archived is missing; a job that needs it says so.
    """
    wanted = archived(archive)
    chosen = [run for folder, run in wanted.items() if folders is None or folder in set(folders)]
    todo = [run for run in chosen if not (results / run.folder / FILE).is_file()]
    for part in parts(archive):
        own = [run for run in todo if run.part == part.name]
        if own:
            frames = {name: _frame(part, name) for name in FRAMES if (part / f"{name}.parquet").is_file()}
            for run in own:
                _restore(run, results / run.folder, frames)
    return len(todo)


def _restore(run: Archived, target: Path, frames: Mapping[str, pd.DataFrame]) -> None:
    files = kept_files(run.folder, frames)
    last = files.pop(FILE)
    for name, content in files.items():
        storage.write_bytes(target / name, content)
    storage.write_bytes(target / FILE, last)


def kept_files(folder: str, frames: Mapping[str, pd.DataFrame]) -> dict[str, bytes]:
    """Every kept file of one run, by name."""

    def own(name: str) -> pd.DataFrame:
        frame = frames.get(name)
        return pd.DataFrame() if frame is None else frame[frame["folder"] == folder].drop(columns="folder")

    files = {str(row.name): str(row.content).encode() for row in own("texts").itertuples(index=False, name="Row")}
    files |= {str(row.name): _unshuffled(bytes(row.content)) for row in own("weights").itertuples(name="Row")}  # type: ignore[arg-type]
    for file, name in CSVS.items():
        frame = own(name)
        if len(frame):
            files[file] = rendered(frame.dropna(axis=1, how="all") if name != "scores" else frame)
    return files


def verify(archive: Path) -> list[str]:
    """What is wrong with the archive, one line each: checksums of parts, identities, bytes of every kept file."""
    wrong: list[str] = []
    for part in parts(archive):
        wrong += [f"{part / name}: {why}" for name, why in _faults(part)]
    if wrong:
        return wrong
    for part in parts(archive):
        frames = {name: _frame(part, name) for name in FRAMES if (part / f"{name}.parquet").is_file()}
        for run in archived(archive).values():
            if run.part == part.name:
                found = {name: digest_of(content) for name, content in kept_files(run.folder, frames).items()}
                differ = [name for name, sha in run.record.files.items() if name in found and found[name] != sha]
                wrong += [f"{part}: {run.folder}/{name} is not what its run wrote" for name in differ]
    return wrong


def _faults(part: Path) -> Iterator[tuple[str, str]]:
    said = storage.read_json(part / MANIFEST) if (part / MANIFEST).is_file() else None
    if not isinstance(said, dict):
        yield MANIFEST, "missing or unreadable"
        return
    for name in sorted({*said, *(path.name for path in part.glob("*.parquet"))}):
        path = part / name
        if name not in said:
            yield name, "not in the manifest"
        elif not path.is_file():
            yield name, "lost"
        elif checksum(path) != said[name]:
            yield name, "changed since it was added"


def read(archive: Path, name: str) -> pd.DataFrame:
    """One tidy frame over all parts, the last version of each run: ``evaluation``, ``curve``, ``scores``, ..."""
    latest = archived(archive)
    frames = []
    for part in parts(archive):
        if (part / f"{name}.parquet").is_file():
            frame = _frame(part, name)
            frames.append(frame[[latest[folder].part == part.name for folder in frame["folder"]]])
    return pd.concat(frames, ignore_index=True) if frames else pd.DataFrame()


def _frame(part: Path, name: str) -> pd.DataFrame:
    return storage.read_parquet(part / f"{name}.parquet")


def _write(path: Path, frame: pd.DataFrame) -> None:
    storage.write_parquet(path, frame, level=15)


def _shuffled(content: bytes) -> bytes:
    """Bytes 0, 4, 8, ... first: exponents of neighbouring floats are alike and compress."""
    return b"".join(content[start::4] for start in range(4))


def _unshuffled(content: bytes) -> bytes:
    whole = bytearray(len(content))
    sizes: Sequence[int] = [len(range(start, len(content), 4)) for start in range(4)]
    begin = 0
    for start, size in enumerate(sizes):
        whole[start::4] = content[begin : begin + size]
        begin += size
    return bytes(whole)


def summary(archive: Path) -> str:
    """How much there is, for people."""
    size = sum(path.stat().st_size for path in archive.rglob("*") if path.is_file())
    counts: dict[str, int] = {}
    for run in archived(archive).values():
        counts[run.record.identity.stage] = counts.get(run.record.identity.stage, 0) + 1
    return json.dumps({"parts": len(parts(archive)), "MiB": round(size / 2**20, 1), "runs": counts})
