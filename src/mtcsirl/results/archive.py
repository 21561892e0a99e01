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
from collections.abc import Collection, Iterable, Iterator
from contextlib import suppress
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path

import pandas as pd

from mtcsirl.errors import UserError
from mtcsirl.files import storage
from mtcsirl.files.identity import (
    FILE,
    NOTE,
    Record,
    lost,
    note,
    read_record,
    result_files,
)
from mtcsirl.files.lock import HeldError
from mtcsirl.results.archived import Archived as Archived
from mtcsirl.results.archived import another as another
from mtcsirl.results.archived import archived as archived
from mtcsirl.results.packing import (
    BLOBS,
    EVERY,
    FRAMES,
    POINTS,
    THINNED,
    Frames,
    by_folder,
    kept,
    packed,
)
from mtcsirl.results.parts import FORMAT, MANIFEST, check, frame, frames, number_of, strangers
from mtcsirl.results.parts import parts as parts
from mtcsirl.results.soundness import Told, faults_of_inputs, faults_of_run, files_of, foreign
from mtcsirl.study.runs import Runs

LEVEL = 19
"""Of zstd: a part is written once and read often."""


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


def add(
    archive: Path,
    results: Path,
    folders: Iterable[str],
    with_policies: Collection[str],
    *,
    replace: bool = False,
) -> Path | None:
    """Add finished runs that the archive lacks as a new part; returns it, or None if there is nothing to add.

    A run that it holds with the same bytes is left out, one that was made again is added again. ``with_policies``:
    folders whose policies are kept too; ``replace``: also runs of other settings, code or inputs than those it holds.

    Raises:
        UserError: a run is not what its record says, or would not come back byte for byte; it is another one than the
            archive's and ``replace`` is false; the archive would lie among runs.
    """
    if (archive / FILE).exists() or archive.resolve() == results.resolve():
        raise UserError(f"{archive}: holds runs; name another folder for the archive")
    with storage.locked(archive):
        for left in archive.glob(".part-*"):
            shutil.rmtree(left, ignore_errors=True)
        known = archived(archive)
        new = [folder for folder in folders if _is_new(known.get(folder), results / folder, folder in with_policies)]
        if not new:
            return None
        for folder in new if not replace else ():
            if folder in known and (why := another(known[folder].record.identity, _whole(results / folder).identity)):
                raise UserError(f"{folder}: {why}; nothing was added; name another --archive, or --replace its runs")
        number = max(map(number_of, parts(archive)), default=0) + 1
        part, draft = archive / f"part-{number:04d}", archive / f".part-{number:04d}"
        try:
            _write(draft, results, new, with_policies)
            wrong = list(faults_of(draft))
            if wrong:
                raise UserError(f"nothing was added: {wrong[0]}")
            os.rename(draft, part)
        finally:
            shutil.rmtree(draft, ignore_errors=True)
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
    if strange := foreign(record):
        raise UserError(f"{source / strange[0]}: no kind of file that the archive knows; make the run again")
    return record


def _write(draft: Path, results: Path, folders: Iterable[str], with_policies: Collection[str]) -> None:
    rows: dict[str, list[pd.DataFrame]] = {name: [] for name in FRAMES}
    for folder in folders:
        for name, own in packed(results / folder, folder, _whole(results / folder), folder in with_policies):
            rows[name].append(own)
    for name, several in rows.items():
        if several:
            storage.write_parquet(draft / f"{name}.parquet", pd.concat(several, ignore_index=True), level=LEVEL)
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
    chosen = {part: {folder for folder in free if known[folder].part == part.name} for part in parts(archive)}
    for fault in (fault for part, own in chosen.items() if own for fault in faults_of(part)):
        raise UserError(f"nothing was restored: {fault}")
    restored = set[str]()
    for part, own in chosen.items():
        if own:
            rows = by_folder({name: found[found["folder"].isin(own)] for name, found in frames(part).items()})
            restored |= {folder for folder in sorted(own) if _restore(known[folder], results / folder, rows[folder])}
    ours, others = (tuple(folder for folder in wanted if (folder in restored) is is_ours) for is_ours in (True, False))
    return Unpacked(ours, others)


def _taken(folder: Path) -> bool:
    """Whether a folder holds a run or the beginnings of one; a killed ``unpack`` leaves a note and no record."""
    if (folder / FILE).is_file():
        return True
    return not (folder / NOTE).is_file() and (bool(result_files(folder)) or any(folder.glob("checkpoint*")))


def _restore(run: Archived, target: Path, own: Frames) -> bool:
    """The note first and the record last, so that whatever is between them is known to be unfinished.

    False: a job holds the folder, or has been there meanwhile.
    """
    files = files_of(own)
    said = note(run.record, set(run.record.files) - set(files)).encode()
    last = files.pop(FILE)
    with suppress(HeldError), storage.locked(target):
        if _taken(target):
            return False
        written: list[Path] = []
        try:
            for name, content in {NOTE: said, **files, FILE: last}.items():
                written.append(target / name)
                storage.restore(target / name, content)
        except OSError as error:
            for path in written:
                with suppress(OSError):
                    storage.remove(path)
            raise OSError(error.errno, error.strerror, str(written[-1])) from error
        return True
    return False


def verify(archive: Path, folders: Collection[str] | None = None) -> list[str]:
    """What is wrong with the archive, one line each: parts, checksums, identities, bytes, gates, what was read.

    ``folders``: say it of these runs alone, and of the parts.
    """
    wrong = list(strangers(archive))
    for part in parts(archive):
        wrong += faults_of(part, folders)
    if not wrong:
        known = archived(archive).values()
        told = (Told(run.folder, run.record.identity, run.record.read, run.record.bytes) for run in known)
        wrong += [f"{archive}: {fault}" for folder, fault in faults_of_inputs(told) if _asked(folder, folders)]
    return wrong


def unverified(runs: Iterable[Archived]) -> list[str]:
    """What the archive holds of these runs that nothing can be held against, one line each."""
    stages = [run.record.identity.stage for run in runs]
    thinned, shown = stages.count("learn_reward"), stages.count("collect_demonstrations")
    lines = (
        (thinned, f"nothing holds: the rows of {thinned} {THINNED}, of which every {EVERY}th iteration is kept"),
        (
            shown,
            f"nothing holds: success and metric in the gates of {shown} demonstrations, whose episodes are not kept",
        ),
    )
    return [line for number, line in lines if number]


def _asked(folder: str, folders: Collection[str] | None) -> bool:
    return folders is None or folder in folders


def faults_of(part: Path, folders: Collection[str] | None = None) -> Iterator[str]:
    """What is wrong with one part, and with these runs of it (None: all)."""
    try:
        check(part)
        rows = by_folder(frames(part))
    except UserError as error:
        yield str(error)
        return
    for folder, own in rows.items():
        if _asked(folder, folders):
            for fault in faults_of_run(folder, own, files_of(own)):
                yield f"{part}: {fault}"


def read(archive: Path, name: str) -> pd.DataFrame:
    """One frame over all parts, the last version of each run: ``evaluation``, ``curve``, ``scores``, ``points``, ...

    Raises:
        UserError: there is no such frame, or a part is damaged.
    """
    if name not in FRAMES:
        raise UserError(f"no frame {name!r} in the archive; it has {', '.join(FRAMES)}")
    latest = {folder: run.part for folder, run in archived(archive).items()}
    found = []
    for part in parts(archive):
        if (part / f"{name}.parquet").is_file():
            rows = frame(part, name)
            found.append(rows[rows["folder"].map(latest) == part.name])
    if name == BLOBS:
        found = [_points(*row) for rows in found for row in rows[["folder", "content"]].itertuples(index=False)]
    return pd.concat(found, ignore_index=True) if found else pd.DataFrame()


def _points(folder: str, content: bytes) -> pd.DataFrame:
    try:
        rows = pd.read_parquet(BytesIO(content))
    except (ValueError, OSError) as error:
        raise UserError(f"{folder}: its {POINTS} is no Parquet file; archive verify says more") from error
    rows.insert(0, "folder", folder)
    return rows


def summary(archive: Path, folders: Collection[str] | None = None) -> list[tuple[str, int, float]]:
    """How much there is: (what, files or runs, MiB) of every stage, frame and part; ``folders``: count these runs."""
    runs = [run for run in archived(archive).values() if _asked(run.folder, folders)]
    stages = [run.record.identity.stage for run in runs]
    rows = [(stage, stages.count(stage), 0.0) for stage in dict.fromkeys(stages)]
    for name in (*(f"{one}.parquet" for one in FRAMES), MANIFEST):
        files = [file for part in parts(archive) if (file := part / name).is_file()]
        rows.append((name, len(files), sum(file.stat().st_size for file in files) / 2**20))
    return rows
