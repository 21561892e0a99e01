"""Stopping in good order: SIGTERM and SIGINT end a job where it can go on from.

Elsewhere than in a block that is `deferred`, a signal ends the job at once, by an exception, so that temporaries go and
locks open. In a deferred block the first signal only asks: the block saves at its next boundary and calls
`stop_here`. A second signal ends at once; the last checkpoint stands.
"""

import os
import signal
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from types import FrameType

_SIGNALS = (signal.SIGTERM, signal.SIGINT)
_deferring = 0
_asked: signal.Signals | None = None


class Stopped(SystemExit):
    """The job ends by a signal; its code is 128 + the signal's number and its text the line for the user."""

    def __init__(self, number: signal.Signals, where: str = "") -> None:
        super().__init__(128 + number)
        self.signal = number
        at, after = (f" at {where}", "here") if where else ("", "its last checkpoint, if it has one")
        self.line = f"stopped{at} by {number.name}; the same command goes on from {after}"


@contextmanager
def heeded() -> Iterator[None]:
    """Handle both signals in the block; one that this process was told to ignore stays ignored (``nohup``, ``&``)."""
    global _asked
    before = {number: signal.getsignal(number) for number in _SIGNALS}
    for number, handler in before.items():
        if handler is not signal.SIG_IGN:
            signal.signal(number, _heed)
    try:
        yield
    finally:
        _asked = None
        for number, handler in before.items():
            signal.signal(number, handler)


@contextmanager
def deferred() -> Iterator[None]:
    """A block, or a function as its decorator, that asks `requested` at boundaries where it can be stopped."""
    global _deferring
    _deferring += 1
    try:
        yield
    finally:
        _deferring -= 1
    if _asked is not None and not _deferring:
        raise Stopped(_asked)


def requested() -> bool:
    """Whether a signal has asked this job to stop."""
    return _asked is not None


def stop_here(where: str) -> None:
    """End the job, all of it saved, if a signal has asked for that; ``where`` says how far it is: ``step 500``.

    Raises:
        Stopped: it was asked to.
    """
    if _asked is not None:
        raise Stopped(_asked, where)


def _heed(number: int, frame: FrameType | None) -> None:
    global _asked
    if not _deferring or _asked is not None:
        raise Stopped(signal.Signals(number))
    _asked = signal.Signals(number)
    line = f"mtcsirl: {_asked.name}: saves and stops at the next boundary; a second signal stops at once\n"
    with suppress(OSError):
        os.write(2, line.encode())
