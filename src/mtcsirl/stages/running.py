"""How every stage runs: it holds its folder, accepts what is there already, and signs what it leaves.

None of this decides a number, so an edit here makes no result stale.
"""

import logging
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path

from mtcsirl.errors import UserError
from mtcsirl.files import storage
from mtcsirl.files.fingerprint import digest
from mtcsirl.files.identity import (
    FILE,
    NOTE,
    Identity,
    Record,
    checksums,
    dumps,
    lost,
    read_record,
    write_marker,
)
from mtcsirl.files.provenance import Stopwatch, write_provenance
from mtcsirl.settings.base import Frozen
from mtcsirl.study import folders

CHECKPOINT = "checkpoint.safetensors"
_LOG = logging.getLogger(__name__)


@dataclass(frozen=True)
class Task:
    """One run to be done: what it is made from, with which settings, over which files, into which folder."""

    identity: Identity
    settings: Frozen
    output: Path
    read: Mapping[str, str] = field(default_factory=dict)
    """Role -> digest of the bytes of an input."""
    files: Mapping[str, Path] = field(default_factory=dict)
    """Input files by name; provenance.json lists their checksums."""
    wanted: str | None = None
    """The hash that a workflow planned for, None outside of one."""


@dataclass(frozen=True)
class Input:
    """What is known of an input: the hash of its identity and the digest of its bytes."""

    hash: str
    bytes: str


def look_at(folder: Path, names: Sequence[str]) -> Input:
    """An input folder by its record; without one by the checksums of the files ``names`` in it."""
    record = read_record(folder)
    if record is not None:
        return Input(record.identity.hash, record.bytes)
    for name in names:
        if not (folder / name).is_file():
            raise UserError(f"{folder / name}: no such file; run the stage that makes it first")
    found = digest(checksums(folder, names))
    return Input(f"sha256:{found}", found)


@contextmanager
def running(task: Task) -> Iterator[Stopwatch | None]:
    """Hold the folder while the block fills it, if that is still to be done; then sign.

    Waits for a process that works there, which may be an orphan of a workflow that was killed. Yields None where a
    finished run of the same identity is there already, else the watch that measures its cost.
    """
    planned(task)
    folders.check_folder(task.output, task.identity.stage, task.identity.key)
    with storage.locked(task.output, wait=True):
        stopwatch = Stopwatch()
        if finished(task):
            _LOG.info("%s: already there, made from the same", task.output)
            write_marker(task.output, task.identity.hash)
            storage.remove(task.output / CHECKPOINT)  # of a run that was killed in its last moment
            yield None
            return
        begin(task)
        yield stopwatch
        sign(task, stopwatch)


def planned(task: Task) -> None:
    """Raise UserError where a workflow planned for another identity than today's code and inputs give."""
    if task.wanted not in (None, task.identity.hash):
        raise UserError(
            f"{task.output}: code, settings or inputs changed since the workflow was planned; start snakemake again"
        )


def finished(task: Task) -> bool:
    """Whether the folder holds a whole run of this identity over these bytes."""
    try:
        record = read_record(task.output)
    except UserError:
        return False
    if record is None or record.identity.hash != task.identity.hash:
        return False
    return not lost(task.output, record) and dict(record.read) == dict(task.read)


def begin(task: Task) -> None:
    """Take the signature off what will be overwritten.

    Raises:
        UserError: the folder holds another run, or what is of no run.
    """
    run = folders.Named(task.identity.stage, task.identity.key)
    folders.check_folder(task.output, *run)
    folders.begin(task.output, run)
    storage.remove(task.output / FILE)
    storage.remove(task.output / NOTE)
    write_marker(task.output, None)


def sign(task: Task, stopwatch: Stopwatch, *, agents: int = 1, lockstep: Sequence[str] = ()) -> None:
    """Leave settings, provenance, record and marker beside the results of a run, one of ``agents`` made at once.

    The checkpoint goes last: until then nothing is lost that was computed.
    """
    storage.write_json(task.output / "settings.json", task.settings.model_dump(mode="json"))
    write_provenance(task.output, stopwatch, task.files, agents=agents, lockstep=lockstep)
    left = checksums(task.output, folders.results_of(task.output, task.identity.stage))
    storage.remove(task.output / folders.BEGUN)
    storage.write_text(task.output / FILE, dumps(Record(task.identity, left, task.read)))
    write_marker(task.output, task.identity.hash)
    storage.remove(task.output / CHECKPOINT)
