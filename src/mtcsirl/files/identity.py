"""The identity of a result: what it was made from. It stands in the result's folder and is compared by everyone.

A result is stale exactly when its number could differ: when its settings, the code that its stage reaches, or what it
read are others. Neither the time of a file nor a workflow's own records decide.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterable, Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

from mtcsirl.errors import UserError
from mtcsirl.files.fingerprint import Code, digest

FORMAT = "mtcsirl identity 1"
FILE = "identity.json"
CHECKPOINT = "checkpoint.safetensors"
"""What a run leaves until it is done, and a run that was killed in its last moment for longer."""
NOTE = "archived.json"
"""Left by an archive in a folder that it restored: which result files it had not kept."""
NOT_RESULTS = (FILE, NOTE, "provenance.json", "checkpoint.safetensors")


@dataclass(frozen=True)
class Identity:
    """What a result is made from; equal identities give equal results."""

    stage: str
    key: Mapping[str, Any]
    """Task, target, seed, ...: whatever the stage is told beside its settings."""
    settings: Mapping[str, Any]
    """The slice of the configuration that the stage reads, without keys whose value is the one of old."""
    code: Code
    inputs: Mapping[str, str]
    """Role -> hash of the identity of what was read, or ``sha256:...`` of a file that has none."""

    @cached_property
    def hash(self) -> str:
        """16 hexadecimal digits."""
        return digest([self.stage, self.key, self.settings, self.code, self.inputs])


@dataclass(frozen=True)
class Record:
    """An identity with what was found and left when the result was made: the content of ``identity.json``."""

    identity: Identity
    files: Mapping[str, str]
    """SHA-256 of each result file, by its path below the folder."""
    read: Mapping[str, str] = field(default_factory=dict)
    """Role -> digest of the bytes that were read."""

    @cached_property
    def bytes(self) -> str:
        """One digest of all result files: two runs of one identity on different machines may differ in it."""
        return digest(dict(self.files))


def dumps(record: Record) -> str:
    """The text of ``identity.json``; it is written after everything that it speaks of."""
    said = {"format": FORMAT, "hash": record.identity.hash, "files": dict(record.files), "read": dict(record.read)}
    said |= {name: getattr(record.identity, name) for name in ("stage", "key", "settings", "code", "inputs")}
    return json.dumps(said, sort_keys=True, separators=(",", ":"), allow_nan=False) + "\n"


REMAKE = "delete its folder and make it again"
"""The way out of a damaged record where its run lies in the results."""


def parse_record(text: str, where: str, way_out: str = REMAKE) -> Record:
    """The record that ``dumps`` wrote; ``way_out``: what a reader may do about one that is damaged.

    Raises:
        UserError: it is damaged or does not fit its own hash.
    """
    try:
        said = json.loads(text)
        identity = Identity(said["stage"], said["key"], said["settings"], said["code"], said["inputs"])
        record = Record(identity, said["files"], said["read"])
        _check_shape(record)
        if said["format"] != FORMAT or said["hash"] != identity.hash:
            raise ValueError("it does not fit its own hash")
    except (ValueError, KeyError, TypeError, AttributeError, RecursionError) as error:
        raise UserError(f"{where}: not a readable identity ({error}); {way_out}") from error
    return record


def _check_shape(record: Record) -> None:
    """Raises ValueError where a part of a record is of another kind than ``dumps`` writes."""
    own = record.identity
    texts = {"files": record.files, "read": record.read, "code": own.code, "inputs": own.inputs}
    for name, found in texts.items():
        if not isinstance(found, dict) or not all(isinstance(value, str) for value in found.values()):
            raise ValueError(f"its {name} are not texts by name")
    if not isinstance(own.stage, str) or not isinstance(own.key, dict) or not isinstance(own.settings, dict):
        raise ValueError("its stage, key or settings are of another kind")


def read_record(folder: Path | str) -> Record | None:
    """The record in ``folder``; None if there is none.

    Raises:
        UserError: it is unreadable.
    """
    path = Path(folder) / FILE
    if path.exists() and not path.is_file():  # a pipe or a device would be read for ever
        raise UserError(f"{path}: not a readable identity (no plain file); {REMAKE}")
    try:
        return parse_record(path.read_text(encoding="utf-8"), str(path))
    except FileNotFoundError:
        return None
    except (OSError, UnicodeDecodeError) as error:
        raise UserError(f"{path}: not a readable identity ({error}); {REMAKE}") from error


def digest_of(content: bytes) -> str:
    """SHA-256 of bytes."""
    return hashlib.sha256(content).hexdigest()


def checksum(path: Path) -> str:
    """SHA-256 of a file, read in pieces."""
    with open(path, "rb") as handle:
        return hashlib.file_digest(handle, "sha256").hexdigest()


def checksums(folder: Path, names: Iterable[str]) -> dict[str, str]:
    """SHA-256 of files below ``folder``."""
    return {name: checksum(folder / name) for name in sorted(names)}


def verify(path: Path) -> None:
    """Hold ``path`` against the record of its folder, or of the one above; nothing where there is none.

    Raises:
        UserError: the file is not what its run wrote.
    """
    for folder in list(path.parents)[:2]:
        record = read_record(folder) if (folder / FILE).is_file() else None
        if record is not None:
            name = path.relative_to(folder).as_posix()
            if name in record.files and record.files[name] != checksum(path):
                raise UserError(
                    f"{path}: changed since its run wrote it (checksum in {FILE}); delete {folder} and make it again"
                )
            return


def lost(folder: Path, record: Record) -> list[str]:
    """Result files of a record that are not there, but for those that an archive had not kept."""
    missing = [name for name in record.files if not (folder / name).is_file()]
    return [name for name in missing if name not in not_kept(folder, record)] if missing else []


def note(record: Record, names: Iterable[str]) -> str:
    """The text of ``archived.json``: of this run an archive has kept all but the result files ``names``."""
    said = {"identity": record.identity.hash, "bytes": record.bytes, "not_kept": sorted(names)}
    return json.dumps(said, indent=2, sort_keys=True) + "\n"


def not_kept(folder: Path, record: Record) -> frozenset[str]:
    """Result files of a record that an archive had not kept, as the note in ``folder`` says of these very bytes.

    A note of another run, or an unreadable one, excuses nothing.
    """
    if not (folder / NOTE).is_file():
        return frozenset()
    try:
        said = json.loads((folder / NOTE).read_text(encoding="utf-8"))
        if said["identity"] == record.identity.hash and said["bytes"] == record.bytes:
            return frozenset(said["not_kept"])
    except (OSError, ValueError, KeyError, TypeError, RecursionError):
        pass
    return frozenset()


def why_absent(path: Path) -> str:
    """Why there is no file ``path``, and the way out."""
    for folder in list(path.parents)[:2]:
        with suppress(UserError):
            record = read_record(folder)
            if record is not None and path.relative_to(folder).as_posix() in not_kept(folder, record):
                return f"was not archived; delete {folder / NOTE}, and snakemake makes the run again"
    return "no such file; run the stage that makes it first"


# --- markers: a workflow's view of identities ---------------------------------------------------------------------


def marker(identity: str) -> str:
    """The name of the file that says, beside results: made with this identity."""
    return f".{identity}.made"


def write_marker(folder: Path, identity: str | None) -> None:
    """Leave the marker of ``identity`` (None: of nothing) in ``folder`` as the only one, if it can be written to."""
    wanted = None if identity is None else marker(identity)
    with suppress(PermissionError):
        for path in folder.glob(marker("*")):
            if path.name != wanted:
                path.unlink(missing_ok=True)
        if wanted is not None:
            (folder / wanted).touch(exist_ok=True)


def result_files(folder: Path) -> list[str]:
    """What a finished run answers for below ``folder``: all but provenance, checkpoint, events and hidden files."""
    found = (path.relative_to(folder) for path in folder.rglob("*") if path.is_file())
    return sorted(path.as_posix() for path in found if not _aside(path))


def _aside(path: Path) -> bool:
    parts = path.parts
    return parts[-1] in NOT_RESULTS or parts[0] == "events" or any(part.startswith(".") for part in parts)


def differences(old: Identity, new: Identity) -> Iterator[str]:
    """Why ``old`` is stale where ``new`` is wanted: each key with both values, definition or input, in one line."""
    for name, before, after in _changed(_flat(old.key), _flat(new.key)):
        yield f"{name}: {before} -> {after}"
    for name, before, after in _changed(_flat(old.settings), _flat(new.settings)):
        yield f"{name}: {before} -> {after}"
    for name, before, after in _changed(old.code, new.code):
        what = "new" if before == NOTHING else "gone" if after == NOTHING else "changed"
        yield f"code: {name.partition('#')[0]} {what}"
    for name, _, after in _changed(old.inputs, new.inputs):
        yield f"input {name}: {'gone' if after == NOTHING else 'another'}"


NOTHING = "nothing"


def _changed(old: Mapping[str, Any], new: Mapping[str, Any]) -> Iterator[tuple[str, Any, Any]]:
    for name in sorted({*old, *new}):
        before, after = old.get(name, NOTHING), new.get(name, NOTHING)
        if before != after:
            yield name, before, after


def _flat(data: Mapping[str, Any], prefix: str = "") -> dict[str, Any]:
    flat: dict[str, Any] = {}
    for name, value in data.items():
        if isinstance(value, Mapping):
            flat |= _flat(value, f"{prefix}{name}.")
        else:
            flat[f"{prefix}{name}"] = value
    return flat
