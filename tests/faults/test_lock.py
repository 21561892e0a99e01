"""One holder per folder, on file systems with and without ``flock``; a dead one never blocks."""

import errno
import fcntl
import logging
import os
import random
import signal
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from mtcsirl.errors import UserError
from mtcsirl.files.lock import NAME, HeldError, is_locked, locked
from tests.faults.harness import LONG, ended, fork

pytestmark = pytest.mark.slow

SECONDS = 60.0 if LONG else 2.0
PROCESSES = 8
WITHOUT = (errno.ENOLCK, errno.ENOSYS, errno.EOPNOTSUPP)
Lock = Callable[[Path], object]


def _without_flock(number: int) -> None:
    def flock(descriptor: int, operation: int) -> None:
        raise OSError(number, os.strerror(number))

    fcntl.flock = flock


def _contend(folder: Path, lock: Lock, number: int, without: int | None) -> None:
    """Hold the folder again and again until the time is over; count own holds and those that had company."""
    if without is not None:
        _without_flock(without)
    logging.disable(logging.CRITICAL)
    random_, end = random.Random(number), time.monotonic() + SECONDS
    holds = broken = 0
    inside = folder.parent / "inside"
    while time.monotonic() < end:
        try:
            with lock(folder):
                try:
                    mark = os.open(inside, os.O_CREAT | os.O_EXCL)
                except FileExistsError:
                    broken += 1
                    continue
                holds += 1
                time.sleep(random_.choice((0, 1e-4, 1e-3)))
                os.close(mark)
                inside.unlink()
        except (HeldError, BlockingIOError):
            continue
        if random_.random() < 0.02:
            is_locked(folder)
    (folder.parent / f"count {number}").write_text(f"{holds} {broken}")


def _contention(tmp_path: Path, lock: Lock, without: int | None = None) -> tuple[int, int]:
    folder = tmp_path / "run"
    children = [fork(lambda n=n: _contend(folder, lock, n, without)) for n in range(PROCESSES)]
    assert [ended(child) for child in children] == [0] * PROCESSES
    counts = [tuple(map(int, path.read_text().split())) for path in tmp_path.glob("count *")]
    holds, broken = (sum(column) for column in zip(*counts, strict=True))
    print(f"{PROCESSES} processes, {SECONDS:.0f} s: {holds} holds, {broken} violations")
    return holds, broken


@pytest.mark.parametrize("without", [None, *WITHOUT], ids=lambda number: errno.errorcode.get(number, "flock"))
def test_eight_processes_and_one_holder(tmp_path: Path, without: int | None) -> None:
    holds, broken = _contention(tmp_path, locked, without)
    assert holds > 100
    assert broken == 0


def test_the_harness_notices_a_lock_that_is_removed_after_it_opened(tmp_path: Path) -> None:
    @contextmanager
    def careless(folder: Path) -> Iterator[None]:
        folder.mkdir(exist_ok=True)
        with open(folder / NAME, "w") as handle:
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
            yield
        (folder / NAME).unlink(missing_ok=True)

    assert _contention(tmp_path, careless)[1] > 0


@pytest.fixture(params=[None, errno.ENOSYS], ids=["flock", "no flock"])
def kind(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> None:
    """Both kinds of file system."""
    if request.param is not None:
        monkeypatch.setattr(fcntl, "flock", fcntl.flock)  # put back afterwards
        _without_flock(request.param)


def _hold(folder: Path, seconds: float) -> int:
    def hold() -> None:
        with locked(folder):
            (folder / "held").touch()
            time.sleep(seconds)

    child = fork(hold)
    while not (folder / "held").exists():
        time.sleep(0.01)
    return child


@pytest.mark.usefixtures("kind")
def test_who_meets_a_holder_is_refused_or_waits(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    caplog.set_level(logging.INFO)
    folder = tmp_path / "run"
    child = _hold(folder, 1.0)
    assert is_locked(folder)
    with pytest.raises(HeldError, match=rf"run: another process writes here \(pid {child}\)"), locked(folder):
        pass
    with pytest.raises(HeldError), locked(folder, wait=0.1):
        pass
    caplog.clear()
    with locked(folder, wait=True):
        assert ended(child) == 0
    waits = [record for record in caplog.records if "waiting" in record.message]
    assert [record.message for record in waits] == [f"waiting for another process that works in {folder} (pid {child})"]
    assert not is_locked(folder)
    assert not (folder / NAME).exists()


@pytest.mark.usefixtures("kind")
def test_a_killed_holder_blocks_nobody_and_its_temporaries_go(tmp_path: Path) -> None:
    folder = tmp_path / "run"
    child = _hold(folder, 60.0)
    os.kill(child, signal.SIGKILL)
    assert ended(child) == -9
    assert (folder / NAME).exists(), "the file stays, the lock does not"
    assert not is_locked(folder)
    left = [folder / ".curve.csv.12.tmp", folder / "policies/.a-t0.json.3.tmp", folder / "inner/.b.4.tmp"]
    stays = [folder / "notes.tmp", folder / ".hidden", folder / "policies/deep/.c.5.tmp"]
    for path in (*left, *stays):
        path.parent.mkdir(parents=True, exist_ok=True)
        path.touch()
    (folder / "inner" / NAME).touch()  # a folder with a lock of its own is left to its holder
    with locked(folder):
        assert [path.exists() for path in left] == [False, False, True]
        assert all(path.exists() for path in stays)


def test_without_flock_it_says_so_once(tmp_path: Path, caplog: pytest.LogCaptureFixture, monkeypatch) -> None:
    monkeypatch.setattr(fcntl, "flock", fcntl.flock)
    _without_flock(errno.ENOLCK)
    with locked(tmp_path / "run"):
        pass
    (record,) = caplog.records
    assert record.message == (
        f"{tmp_path}/run: this file system has no locks (No locks available): "
        "held against other processes of this machine only"
    )
    monkeypatch.setattr("sys.platform", "darwin")
    with pytest.raises(UserError, match="has no locks"), locked(tmp_path / "run"):
        pass


def test_a_lock_that_is_a_link_is_not_followed(tmp_path: Path) -> None:
    precious = tmp_path / "precious"
    precious.write_text("1")
    (tmp_path / NAME).symlink_to(precious)
    with pytest.raises(OSError, match=r"\.lock"), locked(tmp_path):
        pass
    assert precious.read_text() == "1"
