"""What of an archived run is not what a run of its stage leaves, or differs from its record; one line each.

Where names, rows and bytes are sound, the run is also held against its key, its settings and its gate, and then against
the runs that it says it read.
"""

from __future__ import annotations

import json
import re
from collections.abc import Iterable, Iterator, Mapping
from pathlib import PurePosixPath
from typing import Any, NamedTuple

from mtcsirl.errors import UserError
from mtcsirl.files.identity import FILE, Identity, Record, digest_of, parse_record
from mtcsirl.results.packing import (
    BLOBS,
    CSVS,
    DIAGNOSTICS,
    INDEX,
    PROVENANCE,
    TEXTS,
    THINNED,
    WEIGHTS,
    Frames,
    kept,
    unpacked,
)
from mtcsirl.results.parts import AGAIN
from mtcsirl.results.verdicts import faults_of_gate
from mtcsirl.study.keys import read_folder
from mtcsirl.study.outputs import FOLDERS, OUTPUTS
from mtcsirl.study.runs import KINDS

POLICIES = re.compile(r"policies/[\w-]+\.(json|safetensors)", re.ASCII)
"""The files of a folder that a stage leaves beside its outputs."""
TIDY = {**CSVS, THINNED: DIAGNOSTICS}


def leaves(stage: str, name: str) -> bool:
    """Whether ``name`` is a result file that a run of ``stage`` leaves; never one that leads out of its folder."""
    known = name in OUTPUTS.get(stage, ()) and name != PROVENANCE
    return known or (name.startswith(FOLDERS.get(stage, ())) and POLICIES.fullmatch(name) is not None)


def foreign(record: Record) -> list[str]:
    """Files of a record that no run of its stage leaves."""
    return sorted(name for name in record.files if not leaves(record.identity.stage, name))


def files_of(own: Frames) -> dict[str, bytes]:
    """The kept files of a run; none where its rows do not make files."""
    try:
        return unpacked(own)
    except (KeyError, ValueError, TypeError, AttributeError):
        return {}


def faults_of_run(folder: str, own: Frames, files: Mapping[str, bytes]) -> Iterator[str]:
    """What is wrong with one run; its gate is looked at only where the rest is sound."""
    for look in (_faults_of_place, _faults_of_rows, _faults_of_bytes, _faults_of_key, _faults_of_settings):
        wrong = list(look(folder, own, files))
        if wrong:
            yield from wrong
            return
    record = _record(folder, files)
    if "gate.json" in files:
        for fault in faults_of_gate(record.identity, files, own.get(CSVS["evaluation.csv"])):
            yield f"{folder}/gate.json: {fault}"


def _record(folder: str, files: Mapping[str, bytes]) -> Record:
    return parse_record(files[FILE].decode(), folder, AGAIN)


def _faults_of_place(folder: str, own: Frames, files: Mapping[str, bytes]) -> Iterator[str]:
    """The folder is one below the results, there is a record, and every name is one that its stage leaves."""
    if _leads_out(folder):
        yield f"{folder!r}: no folder below the results"
        return
    if INDEX not in own or FILE not in files:
        why = f"lack its {INDEX}" if INDEX not in own else f"lack its {FILE}" if files else "do not make files"
        yield f"{folder}: no rows of an archive (they {why})"
        return
    try:
        record = _record(folder, files)
    except (UserError, UnicodeDecodeError) as error:
        yield str(error) if isinstance(error, UserError) else f"{folder}: no rows of an archive ({error})"
        return
    said = {name for frame in (INDEX, TEXTS, WEIGHTS, BLOBS) if frame in own for name in own[frame]["file"]}
    for name in sorted({*said, *record.files}):
        if not leaves(record.identity.stage, name) and (name not in (FILE, PROVENANCE) or name in record.files):
            yield f"{folder}: {name!r} is no file that a run of {record.identity.stage!r} leaves"


def _leads_out(folder: str) -> bool:
    """Whether a folder may lie elsewhere than below the results, or cannot be shown in a line."""
    path = PurePosixPath(folder)
    plain = str(path) == folder and folder.isprintable() and not path.is_absolute()
    return not plain or not path.parts or ".." in path.parts


def _faults_of_rows(folder: str, own: Frames, files: Mapping[str, bytes]) -> Iterator[str]:
    """Each file stands once in the index, and rows belong to a file of it."""
    for frame in (INDEX, TEXTS, WEIGHTS, BLOBS):
        if frame in own and own[frame]["file"].duplicated().any():
            yield f"{folder}: a file stands twice in {frame}"
    columns = {row["file"]: row["columns"].split(",") for row in own[INDEX].to_dict("records")}
    for name, frame in TIDY.items():
        if name not in columns and frame in own:
            yield f"{folder}: rows in {frame} of a file {name} that it does not have"
        elif frame in own:
            others = [column for column in own[frame].columns if column not in columns[name]]
            if own[frame][others].notna().to_numpy().any():
                yield f"{folder}: columns in {frame} that {name} does not have"


def _faults_of_bytes(folder: str, own: Frames, files: Mapping[str, bytes]) -> Iterator[str]:
    """Every file is what its run wrote, and kept where an archive keeps it."""
    record, index = _record(folder, files), own[INDEX].set_index("file")
    outputs = OUTPUTS.get(record.identity.stage, ())
    for name in sorted({*index.index, *record.files, *files, *outputs, FILE, PROVENANCE}):
        if name not in index.index:
            yield f"{folder}/{name}: not in {INDEX}"
            continue
        fault = _fault_of_file(name, index.loc[name], record, files, name in TIDY and TIDY[name] in own)
        if fault:
            yield f"{folder}/{name}: {fault}"


def _fault_of_file(name: str, said: Any, record: Record, files: Mapping[str, bytes], has_rows: bool) -> str:
    sha, keeps = said["sha256"], bool(said["kept"])
    if name not in record.files and name not in (FILE, PROVENANCE):
        return "not in its identity"
    if record.files.get(name, sha) != sha:
        return "another checksum than in its identity"
    if keeps and not kept(name, policies=True):
        return "said to be kept, which an archive does not"
    if not keeps and kept(name, policies=False):
        return "said not to be kept, which an archive does"
    if not keeps and (name in files or (has_rows and name != THINNED)):
        return "said not to be kept, but its content is there"
    if keeps and (name not in files or digest_of(files[name]) != sha):
        return "is not what its run wrote"
    return ""


def _faults_of_key(folder: str, own: Frames, files: Mapping[str, bytes]) -> Iterator[str]:
    """The folder says the same as the key in the identity."""
    identity = _record(folder, files).identity
    place = place_of(identity.stage, folder)
    if place is None:
        yield f"{folder}: no folder of a run of {identity.stage}"
        return
    for name, value in identity.key.items():
        if name in place and place[name] != str(value):
            yield f"{folder}: another run's, by its identity: {name} {value}"


def place_of(stage: str, folder: str) -> dict[str, str] | None:
    """What a folder says of its run; None where no run of ``stage`` lands there."""
    found = (read_folder(kind.PATTERN, folder) for kind in KINDS if kind.stage == stage)
    return next((place for place in found if place is not None), None)


def _faults_of_settings(folder: str, own: Frames, files: Mapping[str, bytes]) -> Iterator[str]:
    """The identity's settings are those of ``settings.json``, which has more."""
    identity = _record(folder, files).identity
    try:
        said = json.loads(files["settings.json"])
    except (ValueError, RecursionError):
        yield f"{folder}/settings.json: not a readable JSON file"
        return
    name = _another(identity.settings, said)
    if name is not None:
        yield f"{folder}/settings.json: another {name} than in its identity"


def _another(wanted: Mapping[str, Any], said: Any) -> str | None:
    """The first key of ``wanted`` that ``said`` lacks or has another value of."""
    for name, value in wanted.items():
        if not isinstance(said, dict) or name not in said:
            return name
        if isinstance(value, dict):
            deeper = _another(value, said[name])
            if deeper is not None:
                return f"{name}.{deeper}"
        elif said[name] != value:
            return name
    return None


class Told(NamedTuple):
    """An archived run, as far as others have read it."""

    folder: str
    identity: Identity
    read: Mapping[str, str]
    bytes: str


def faults_of_inputs(runs: Iterable[Told]) -> Iterator[tuple[str, str]]:
    """Folder and fault of runs that read other bytes than the archived run that they name, or name another's.

    A run that is not in the archive, or is there under other settings, says nothing.
    """
    runs = list(runs)
    by_hash: dict[str, list[Told]] = {}
    for run in runs:
        by_hash.setdefault(run.identity.hash, []).append(run)
    for run in runs:
        for role, wanted in run.identity.inputs.items():
            named = by_hash.get(wanted, [])
            if named and all(one.bytes != run.read.get(role, one.bytes) for one in named):
                yield (
                    run.folder,
                    f"{run.folder}: its {role} had other bytes than the archive's {named[0].folder}",
                )
            elif named and not any(_belongs(run, one) for one in named):
                yield run.folder, f"{run.folder}: names {named[0].folder} as its {role}, which belongs to other runs"


def _belongs(run: Told, other: Told) -> bool:
    """Whether two folders say the same of method, task, cs-reward, ...; seeds may differ, and variants."""
    mine, its = place_of(run.identity.stage, run.folder), place_of(other.identity.stage, other.folder)
    if mine is None or its is None:
        return False
    return all(mine[name] == its[name] for name in set(mine) & set(its) - {"seed", "variant"})
