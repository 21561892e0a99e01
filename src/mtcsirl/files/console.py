"""What a job says: messages never fail it, and what earlier tries said stays.

A closed pipe (``| head -1``), a closed stream (``>&-``), a full disk under a log and an alphabet without some letter
cost words, never results.
"""

import errno
import io
import os
import re
import shlex
import stat
import sys
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any


def plain(text: str) -> str:
    """``text`` on one line and without what a terminal would act on: names in strangers' files may hold anything."""
    return "".join(c if c.isprintable() else c.encode("unicode_escape").decode() for c in " ".join(text.split("\n")))


class PatientFile(io.FileIO):
    """A stream's file; after its first failure it takes what is written and drops it. ``failure`` says why."""

    failure: OSError | None = None

    def write(self, data: Any) -> int:
        """Write, or drop."""
        if self.failure is None:
            try:
                return super().write(data)
            except OSError as error:
                self.failure = error
        return memoryview(data).nbytes


def protect() -> None:
    """Make standard output and standard error streams that never raise, where they are the process's own.

    A closed one is opened on nothing first: else the next file that is opened would get its number, and whatever a
    library prints.
    """
    for number in (0, 1, 2):
        try:
            os.fstat(number)
        except OSError:
            os.set_inheritable(os.open(os.devnull, os.O_RDWR), True)  # the lowest free number is this one
    for number, name in ((1, "stdout"), (2, "stderr")):
        stream = getattr(sys, name)
        if stream is getattr(sys, f"__{name}__"):  # else somebody listens, a test for example
            if stream is not None:
                stream.flush()
            setattr(sys, name, _patient(number, getattr(stream, "encoding", None)))


def _patient(number: int, encoding: str | None) -> io.TextIOWrapper:
    raw = PatientFile(number, "w", closefd=False)
    # by lines, so that a log holds what its job had said when it is killed
    return io.TextIOWrapper(io.BufferedWriter(raw), encoding, "replace", line_buffering=True)


def lost() -> str | None:
    """Why standard output lost something, unless its reader went away, which is the reader's wish."""
    file = getattr(getattr(sys.stdout, "buffer", None), "raw", None)
    failure = file.failure if isinstance(file, PatientFile) else None
    return None if failure is None or failure.errno == errno.EPIPE else failure.strerror


@contextmanager
def logged(words: Sequence[str]) -> Iterator[None]:
    """Where both streams go into one file ``NAME.log``, begin with a line about this try and keep the file.

    Snakemake removes the log of an earlier try before it starts the next. So a try that has not ended well stays as
    ``NAME.1.log``, ``NAME.2.log``, ... beside it: another name of the same file, which costs nothing. So does that of
    an orphan whose ``NAME.log`` is a later try's by now.
    """
    log = _log_file()
    if log is None:
        yield
        return
    print(f"--- {time.strftime('%Y-%m-%d %H:%M:%S')} pid {os.getpid()}: {_short(shlex.join(words))}", file=sys.stderr)
    kept = _kept(log)
    yield
    if kept is not None:
        with suppress(OSError):
            if kept.samefile(log):
                kept.unlink()


def _short(text: str, most: int = 300) -> str:
    return text if len(text) <= most else f"{text[:most]} ..."


def _log_file() -> Path | None:
    """The file NAME.log that both streams of this process go into."""
    try:
        files = [os.fstat(number) for number in (1, 2)]
        path = Path(os.readlink("/proc/self/fd/2"))
        same = os.path.samestat(*files) and os.path.samestat(files[0], path.lstat())
    except OSError:
        return None
    return path if same and stat.S_ISREG(files[0].st_mode) and path.suffix == ".log" else None


def _kept(log: Path) -> Path | None:
    """Give the log its lasting name; None where it has one, or where the file system has no links."""
    number = re.compile(re.escape(log.stem) + r"\.(\d+)\.log")
    with suppress(OSError):
        if log.stat().st_nlink > 1:
            return None
        tries = [int(found[1]) for entry in log.parent.iterdir() if (found := number.fullmatch(entry.name))]
        kept = log.with_name(f"{log.stem}.{max(tries, default=0) + 1}.log")
        os.link(log, kept)
        return kept
    return None
