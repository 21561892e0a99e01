"""Runs small enough to be broken many times: each in a fork of this process, which has all libraries loaded."""

import os
import signal
import sys
import time
import traceback
from collections.abc import Callable
from pathlib import Path

from mtcsirl.files import stop

LONG = os.environ.get("MTCSIRL_FAULTS") == "long"
"""Everything in place of a sample: minutes instead of seconds."""

Stage = Callable[[Path], None]


def fork(work: Callable[[], object]) -> int:
    """Do ``work`` in a child that ends like a job of the command line; its pid."""
    sys.stdout.flush()
    sys.stderr.flush()
    child = os.fork()
    if child:
        return child
    code = 1
    try:
        nothing = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nothing, 1)
        os.dup2(nothing, 2)
        signal.signal(signal.SIGINT, signal.default_int_handler)
        with stop.heeded():
            work()
        code = 0
    except stop.Stopped as stopped:
        code = 128 + stopped.signal
    except BaseException:
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
