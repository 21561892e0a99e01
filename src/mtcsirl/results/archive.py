"""The evidence archive: what a third party needs to check every number without training, in parts that are only added.

A part is a folder ``part-0001`` of Parquet files and a manifest with their SHA-256; no part is ever written again. Tidy
frames (``evaluation``, ``curve``, ``scores``, ``diagnostics``) are to be read in pandas, with the run's folder in the
first column; ``texts`` holds identities, provenance, settings, gates and descriptions as they are, ``weights`` the
learned rewards and some policies, ``points`` the files of scored transitions. Out of these every kept file comes back
byte for byte, as the checksums in its run's identity say; ``files`` names what is kept and what is not.
"""

from __future__ import annotations

import os
import shutil
from collections.abc import Collection, Iterable, Iterator, Mapping
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path

import pandas as pd

from mtcsirl.errors import UserError
from mtcsirl.files import storage
from mtcsirl.files.identity import FILE, NOTE, Record, digest_of, lost, note, parse_record, read_record, result_files
from mtcsirl.results.packing import BLOBS, FRAMES, INDEX, TEXTS, Frames, by_folder, kept, packed, unpacked
from mtcsirl.study.runs import Runs

MANIFEST = "manifest.json"
FORMAT = "mtcsirl archive 1"
AGAIN = "get this part again from where the archive came from"
LEVEL = 19
"""Of zstd: a part is written once and read often."""


@dataclass(frozen=True)
class Archived:
    """One run in the archive."""

    folder: str
    part: str
    record: Record
    kept: frozenset[str]
    """Its result files that come back."""


@dataclass(frozen=True)
class Unpacked:
    """Folders that were restored, and those that were left alone because something is there."""

    restored: tuple[str, ...]
    left_alone: tuple[str, ...]


def policies_kept(study: Runs) -> set[str]:
    """Folders of the agents whose policies are kept: experts and baselines that a score reads.

    All policies of the study would be three times what a repository can hold; these experts also demonstrated.
    """
    return {run.folder for score in study.scores for run in (*score.experts, *score.baselines)}


def parts(archive: Path) -> list[Path]:
    """The folders of the archive, in the order in which they were added."""
    return sorted(path for path in archive.glob(f"part-{'[0-9]' * 4}") if path.is_dir())


def archived(archive: Path) -> dict[str, Archived]:
    """The runs of the archive by their folder; of a run that was added twice, the last.

    Raises:
        UserError: a part is damaged.
    """
    return {run.folder: run for part in parts(archive) for run in _of_part(part)}


def _of_part(part: Path) -> Iterator[Archived]:
    _check(part)
    texts, index = _frame(part, TEXTS), _frame(part, INDEX)
    names = index[index["kept"]].groupby("folder", observed=True)["file"].agg(frozenset)
    for folder, text in texts.loc[texts["file"] == FILE, ["folder", "content"]].itertuples(index=False):
        record = parse_record(text, f"{part}: {folder}")
        yield Archived(folder, part.name, record, names[folder] & frozenset(record.files))


def add(archive: Path, results: Path, folders: Iterable[str], with_policies: Collection[str]) -> Path | None:
    """Add finished runs that the archive lacks as a new part; returns it, or None if there is nothing to add.

    A run that it holds with the same bytes is left out, one that was made again is added again. ``with_policies``:
    folders whose policies are kept too.

    Raises:
        UserError: a run is not what its record says, or would not come back byte for byte.
    """
    with storage.locked(archive):
        known = archived(archive)
        new = [folder for folder in folders if _is_new(known.get(folder), results / folder, folder in with_policies)]
        if not new:
            return None
        number = max((int(part.name.removeprefix("part-")) for part in parts(archive)), default=0) + 1
        part, draft = archive / f"part-{number:04d}", archive / f".part-{number:04d}"
        shutil.rmtree(draft, ignore_errors=True)
        _write(draft, results, new, with_policies)
        wrong = list(faults_of(draft))
        if wrong:
            raise UserError(f"nothing was added: {wrong[0]}")
        os.rename(draft, part)
        return part


def _is_new(old: Archived | None, source: Path, policies: bool) -> bool:
    record = _whole(source)
    if old is None or old.record != record:
        return True
    wanted = {name for name in record.files if kept(name, policies) and (source / name).is_file()}
    return not wanted <= old.kept


def _whole(source: Path) -> Record:
    record = read_record(source)
    if record is None or lost(source, record):
        raise UserError(f"{source}: no finished run; add it when it is done")
    return record


def _write(draft: Path, results: Path, folders: Iterable[str], with_policies: Collection[str]) -> None:
    rows: dict[str, list[pd.DataFrame]] = {name: [] for name in FRAMES}
    for folder in folders:
        for name, frame in packed(results / folder, folder, _whole(results / folder), folder in with_policies):
            rows[name].append(frame)
    for name, frames in rows.items():
        if frames:
            frame = pd.concat(frames, ignore_index=True)
            storage.write_parquet(draft / f"{name}.parquet", frame, level=LEVEL)
    sums = {path.name: storage.checksum(path) for path in sorted(draft.glob("*.parquet"))}
    storage.write_json(draft / MANIFEST, {"format": FORMAT, "files": sums})


def unpack(archive: Path, results: Path, folders: Iterable[str] | None = None) -> Unpacked:
    """Restore runs (None: all) below ``results``, so that a workflow goes on from them.

    A folder that holds anything is left alone. The note ``archived.json`` in a restored one names what was not kept.

    Raises:
        UserError: a part is damaged, or a run in it is not what was added.
    """
    known = archived(archive)
    wanted = list(known) if folders is None else [folder for folder in folders if folder in known]
    free = [folder for folder in wanted if not _taken(results / folder)]
    for part in parts(archive):
        chosen = {folder for folder in free if known[folder].part == part.name}
        if chosen:
            rows = by_folder({name: frame[frame["folder"].isin(chosen)] for name, frame in _frames(part).items()})
            for folder in sorted(chosen):
                _restore(known[folder], results / folder, rows[folder])
    return Unpacked(tuple(free), tuple(folder for folder in wanted if folder not in set(free)))


def _taken(folder: Path) -> bool:
    """Whether a folder holds a run or the beginnings of one; a killed ``unpack`` leaves a note and no record."""
    if (folder / FILE).is_file():
        return True
    return not (folder / NOTE).is_file() and (bool(result_files(folder)) or any(folder.glob("checkpoint*")))


def _restore(run: Archived, target: Path, own: Frames) -> None:
    """The note first and the record last, so that whatever is between them is known to be unfinished."""
    files = _files(own)
    wrong = list(_faults_of_run(run.folder, own, files))
    if wrong:
        raise UserError(f"{run.part}: {wrong[0]}")
    last = files.pop(FILE)
    with storage.locked(target):
        storage.write_text(target / NOTE, note(run.record, set(run.record.files) - set(files)))
        for name, content in files.items():
            storage.restore(target / name, content)
        storage.restore(target / FILE, last)


def verify(archive: Path) -> list[str]:
    """What is wrong with the archive, one line each: parts, checksums, identities, bytes of every kept file."""
    found = parts(archive)
    names = [f"part-{number + 1:04d}" for number in range(len(found))]
    wrong = [f"{archive / name}: lost, or not a part" for name in names if not (archive / name).is_dir()]
    for part in found:
        wrong += faults_of(part)
    return wrong


def faults_of(part: Path) -> Iterator[str]:
    """What is wrong with one part."""
    try:
        _check(part)
        rows = by_folder(_frames(part))
    except UserError as error:
        yield str(error)
        return
    for folder, own in rows.items():
        for fault in _faults_of_run(folder, own, _files(own)):
            yield f"{part}: {fault}"


def _files(own: Frames) -> dict[str, bytes]:
    """The kept files of a run; none where its rows are no archive's."""
    try:
        return unpacked(own)
    except (KeyError, ValueError, TypeError, AttributeError):
        return {}


def _faults_of_run(folder: str, own: Frames, files: Mapping[str, bytes]) -> Iterator[str]:
    """What of one run differs from its record and its index."""
    try:
        record = parse_record(files[FILE].decode(), folder)
        index = own[INDEX].set_index("file")
    except (KeyError, ValueError, UserError) as error:
        yield f"{folder}: no rows of an archive ({error})"
        return
    for name in sorted({*index.index, *record.files, *files}):
        if name not in index.index:
            yield f"{folder}/{name}: not in {INDEX}"
        elif name in record.files and record.files[name] != index.at[name, "sha256"]:
            yield f"{folder}/{name}: another checksum than in its identity"
        elif index.at[name, "kept"] and (name not in files or digest_of(files[name]) != index.at[name, "sha256"]):
            yield f"{folder}/{name}: is not what its run wrote"


def read(archive: Path, name: str) -> pd.DataFrame:
    """One frame over all parts, the last version of each run: ``evaluation``, ``curve``, ``scores``, ``points``, ...

    Raises:
        UserError: there is no such frame, or a part is damaged.
    """
    if name not in FRAMES:
        raise UserError(f"no frame {name!r} in the archive; it has {', '.join(FRAMES)}")
    latest = {folder: run.part for folder, run in archived(archive).items()}
    frames = []
    for part in parts(archive):
        if (part / f"{name}.parquet").is_file():
            frame = _frame(part, name)
            frames.append(frame[frame["folder"].map(latest) == part.name])
    if name == BLOBS:
        frames = [_points(*row) for frame in frames for row in frame[["folder", "content"]].itertuples(index=False)]
    return pd.concat(frames, ignore_index=True) if frames else pd.DataFrame()


def _points(folder: str, content: bytes) -> pd.DataFrame:
    frame = pd.read_parquet(BytesIO(content))
    frame.insert(0, "folder", folder)
    return frame


def _frames(part: Path) -> dict[str, pd.DataFrame]:
    return {name: _frame(part, name) for name in FRAMES if (part / f"{name}.parquet").is_file()}


def _frame(part: Path, name: str) -> pd.DataFrame:
    return storage.read_parquet(part / f"{name}.parquet")


def _check(part: Path) -> None:
    """Hold every file of a part against its manifest.

    Raises:
        UserError: one was changed, lost or put there.
    """
    said = storage.read_json(part / MANIFEST)
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


def summary(archive: Path) -> list[tuple[str, int, float]]:
    """How much there is: (what, files or runs, MiB) of every stage, frame and part."""
    runs = archived(archive).values()
    stages = [run.record.identity.stage for run in runs]
    rows = [(stage, stages.count(stage), 0.0) for stage in dict.fromkeys(stages)]
    for name in (*(f"{frame}.parquet" for frame in FRAMES), MANIFEST):
        files = list(archive.glob(f"part-*/{name}"))
        rows.append((name, len(files), sum(file.stat().st_size for file in files) / 2**20))
    return rows
