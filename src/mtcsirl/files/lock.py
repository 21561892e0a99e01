"""One holder per folder: an orphan job cannot write beside its successor.

The kernel's lock (``flock``) on the file ``.lock`` goes with its holder, however that dies. The file goes too, and a
process that locked one which is no longer the folder's begins again: so no two ever hold a folder. On a file system
without ``flock`` (some Lustre and NFS mounts) the holder binds a socket named after the folder instead, which other
processes of the same machine meet, and says so in one line.
"""

import errno
import fcntl
import hashlib
import logging
import os
import re
import socket
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from functools import partial
from pathlib import Path

from mtcsirl.errors import UserError

NAME = ".lock"
_HELD = (errno.EAGAIN, errno.EACCES)
_UNSUPPORTED = (errno.ENOLCK, errno.ENOSYS, errno.EOPNOTSUPP)
_TEMPORARY = re.compile(r"\..+\.\d+\.tmp")
_ASKING_SECONDS = 0.05
"""How long `is_locked` of other processes may get in a holder's way: for this time nobody is refused."""
_LOG = logging.getLogger(__name__)
Release = Callable[[], None]


class HeldError(UserError):
    """Another process holds the folder."""


@contextmanager
def locked(folder: Path | str, wait: float | bool | None = None) -> Iterator[Path]:
    """Hold ``folder`` (made if missing) for one process, and remove what writers left there that died.

    wait: None: whoever meets a holder is refused; seconds: waits so long at most; True: until the holder ends.

    Raises:
        HeldError: another process holds the folder.
        OSError: the folder cannot be made or written.
    """
    folder = Path(folder)
    release = _acquired(folder, wait)
    try:
        _remove_temporaries(folder)
        yield folder
    finally:
        release()


def is_locked(folder: Path | str) -> bool:
    """Whether a process holds ``folder``. Makes nothing, and a process that starts meanwhile is not refused."""
    try:
        descriptor = os.open(Path(folder) / NAME, os.O_RDONLY | os.O_NOFOLLOW)
    except OSError:
        return False
    try:
        fcntl.flock(descriptor, fcntl.LOCK_SH | fcntl.LOCK_NB)
    except OSError as error:
        if error.errno not in _UNSUPPORTED:
            return True
        holder = _bound(Path(folder))
        if holder is not None:
            holder.close()
        return holder is None
    finally:
        os.close(descriptor)
    return False


def _acquired(folder: Path, wait: float | bool | None) -> Release:
    """Hold the folder at once or after waiting; returns what lets it go."""
    start, pause, told = time.monotonic(), 0.01, False
    patience = float("inf") if wait is True else max(float(wait or 0.0), _ASKING_SECONDS)
    while (release := _attempt(folder)) is None:
        waited = time.monotonic() - start
        if waited >= patience:
            raise HeldError(f"{folder}: another process writes here{_holder(folder)}; wait for it or stop it")
        if waited >= _ASKING_SECONDS and not told:
            _LOG.info("waiting for another process that works in %s%s", folder, _holder(folder))
            told = True
        time.sleep(min(pause, patience - waited))
        pause = min(2 * pause, 0.5)
    return release


def _attempt(folder: Path) -> Release | None:
    """Hold the folder, or None if another process does."""
    path = folder / NAME
    while True:
        descriptor = _opened(path)
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError as error:
            os.close(descriptor)
            if error.errno in _UNSUPPORTED:
                return _attempt_by_socket(path, error)
            if error.errno in _HELD:
                return None
            raise
        if _is_at(descriptor, path):
            _sign(descriptor)
            return partial(_let_go, descriptor, path)
        os.close(descriptor)


def _opened(path: Path) -> int:
    """Open the lock file, made if missing; a link is not followed, since what it leads to would be overwritten."""
    while True:
        path.parent.mkdir(parents=True, exist_ok=True)
        with suppress(FileNotFoundError):  # the folder went in between
            return os.open(path, os.O_RDWR | os.O_CREAT | os.O_NOFOLLOW, 0o666)


def _is_at(descriptor: int, path: Path) -> bool:
    """Whether the locked file is still the folder's: its last holder may have removed it before letting go.

    It is opened anew, since a network file system may answer ``stat`` from memory.
    """
    try:
        again = os.open(path, os.O_RDONLY | os.O_NOFOLLOW)
    except FileNotFoundError:
        return False
    try:
        return os.path.samestat(os.fstat(descriptor), os.fstat(again))
    finally:
        os.close(again)


def _let_go(descriptor: int, path: Path) -> None:
    """Remove the file while nobody else can hold it; then open the lock, which ends it for those who wait."""
    with suppress(OSError):
        path.unlink()
    os.close(descriptor)


def _sign(descriptor: int) -> None:
    """Write who holds the lock, for those who meet it; a full disk is no reason to refuse."""
    with suppress(OSError):
        os.ftruncate(descriptor, 0)
        os.pwrite(descriptor, f"{os.getpid()} {socket.gethostname()}\n".encode(), 0)


def _holder(folder: Path) -> str:
    """Who holds the folder, as its lock file says: `` (pid N)``, with the machine if it is another."""
    try:
        text = (folder / NAME).read_bytes()[:300].decode(errors="replace")
    except OSError:
        return ""
    found = re.fullmatch(r"(\d+) ([\w.-]+)\n", text)
    if found is None:
        return ""
    elsewhere = "" if found[2] == socket.gethostname() else f" on {found[2]}"
    return f" (pid {found[1]}{elsewhere})"


def _attempt_by_socket(path: Path, error: OSError) -> Release | None:
    folder = path.parent
    if sys.platform != "linux":
        raise UserError(f"{folder}: this file system has no locks ({error.strerror}); keep results on another")
    holder = _bound(folder)
    if holder is None:
        return None
    _LOG.warning(
        "%s: this file system has no locks (%s): held against other processes of this machine only",
        folder,
        error.strerror,
    )
    descriptor = _opened(path)  # again, since the last holder may have removed it until here
    _sign(descriptor)
    os.close(descriptor)
    return partial(_let_go, holder.detach(), path)


def _bound(folder: Path) -> socket.socket | None:
    """Bind the socket of a folder, which the kernel frees when its holder ends; None if another process has it."""
    holder = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
    try:
        holder.bind(b"\0mtcsirl:" + hashlib.sha256(os.fsencode(folder.resolve())).hexdigest().encode())
    except OSError as error:
        holder.close()
        if error.errno != errno.EADDRINUSE:
            raise
        return None
    return holder


def _remove_temporaries(folder: Path) -> None:
    """Remove temporaries of dead writers, here and one level below: only the holder of a folder writes in it."""
    own = [entry for entry in folder.iterdir() if entry.is_dir() and not (entry / NAME).exists()]
    for place in (folder, *own):
        for entry in place.iterdir():
            if _TEMPORARY.fullmatch(entry.name):
                with suppress(OSError):
                    entry.unlink()
