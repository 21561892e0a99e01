"""Runs small enough to be broken many times: each in a fork of this process, which has all libraries loaded."""

import os
import signal
import sys
import time
import traceback
from collections.abc import Callable
from pathlib import Path

from mtcsirl.cli import stopped_by
from mtcsirl.files import stop

SIGNALS = (signal.SIGTERM, signal.SIGINT)
LONG = os.environ.get("MTCSIRL_FAULTS") == "long"
"""Everything in place of a sample: minutes instead of seconds."""

Stage = Callable[[Path], None]


def fork(work: Callable[[], object]) -> int:
    """Do ``work`` in a child that ends like a job of the command line; its pid."""
    sys.stdout.flush()
    sys.stderr.flush()
    # a signal that comes before the child heeds it, or after, waits: it would hit what is no job
    before = signal.pthread_sigmask(signal.SIG_BLOCK, SIGNALS)
    child = os.fork()
    if child:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)
        return child
    code = 1
    try:
        sys.settrace(None)  # coverage would slow the child down and be lost with it
        nothing = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nothing, 1)
        os.dup2(nothing, 2)
        signal.signal(signal.SIGINT, signal.default_int_handler)
        with stop.heeded():
            try:
                signal.pthread_sigmask(signal.SIG_UNBLOCK, SIGNALS)
                work()
            finally:
                signal.pthread_sigmask(signal.SIG_BLOCK, SIGNALS)
        code = 0
    except BaseException as error:
        stopped = stopped_by(error)
        code = 1 if stopped is None else 128 + stopped.signal
        if stopped is None:
            traceback.print_exc()
    finally:
        os._exit(code)


def ended(child: int) -> int:
    """Wait for a child: its exit code, or minus the signal that killed it."""
    return os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])


def seconds_of(work: Callable[[], object]) -> float:
    """How long ``work`` takes in a child that nobody disturbs."""
    start = time.monotonic()
    assert ended(fork(work)) == 0
    return time.monotonic() - start


def contents(folder: Path) -> dict[str, bytes]:
    """Every file of a run but those that tell of time and place."""
    files = (path for path in sorted(folder.rglob("*")) if path.is_file() and path.name != "provenance.json")
    return {str(path.relative_to(folder)): path.read_bytes() for path in files}
