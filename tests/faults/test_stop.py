"""SIGTERM and SIGINT save at the next boundary, say so, and the same command goes on from there."""

import os
import re
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from mtcsirl.files import stop
from tests.faults.command import RESULTS, train
from tests.faults.harness import contents

pytestmark = pytest.mark.slow


@pytest.fixture(autouse=True)
def _heeding_ctrl_c() -> Iterator[None]:
    """A shell's background jobs ignore it, these tests among them, and what they start inherits that."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


def _started(command: list[str], folder: Path) -> subprocess.Popen[str]:
    job = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
    while not list(folder.glob("checkpoint*")):
        assert job.poll() is None
        time.sleep(0.01)
    return job


@pytest.mark.parametrize(("number", "code"), [(signal.SIGTERM, 143), (signal.SIGINT, 130)])
def test_a_stopped_job_saves_and_says_where(tmp_path: Path, number: signal.Signals, code: int) -> None:
    slow = {"steps": 6_000, "sac__updates_per_step": 0.1, "progress__checkpoint_every": 2_000}
    folder = tmp_path / "run"
    job = _started(train(folder, **slow), folder)
    job.send_signal(number)
    asked, said = job.communicate(timeout=60)[1].splitlines()
    assert job.returncode == code
    assert asked == f"mtcsirl: {number.name}: saves and stops at the next boundary; a second signal stops at once"
    found = re.fullmatch(rf"mtcsirl: stopped at step (\d+) by {number.name}; the same command goes on from here", said)
    assert found is not None
    assert 2_000 <= int(found[1]) < 6_000, "at the checkpoint it was seen at, or later"
    assert int(found[1]) % 2_000, "not the checkpoint that was there anyhow"
    assert not set(contents(folder)) & RESULTS
    again = subprocess.run(train(folder, **slow), capture_output=True, text=True, check=True)
    assert f"resumed at step {found[1]}" in again.stdout
    subprocess.run(train(tmp_path / "whole", **slow), capture_output=True, check=True)
    assert contents(folder) == contents(tmp_path / "whole")


def _raises(*numbers: signal.Signals) -> None:
    for number in numbers:
        os.kill(os.getpid(), number)
    assert stop.requested()


def test_a_second_signal_stops_at_once() -> None:
    both = stop.deferred()(_raises)
    with stop.heeded(), pytest.raises(stop.Stopped) as stopped:
        both(signal.SIGTERM, signal.SIGTERM)
    assert stopped.value.code == 143
    assert stopped.value.line == "stopped by SIGTERM; the same command goes on from its last checkpoint, if it has one"
    assert stopped.traceback[-1].name == "_heed", "while it works, not at its end"


def test_outside_of_a_deferred_block_the_first_one_does() -> None:
    with stop.heeded(), pytest.raises(stop.Stopped) as stopped:
        _raises(signal.SIGINT)
    assert stopped.traceback[-1].name == "_heed"


def test_a_signal_after_the_last_boundary_is_not_forgotten() -> None:
    once = stop.deferred()(_raises)
    with stop.heeded(), pytest.raises(stop.Stopped) as stopped:
        once(signal.SIGTERM)
    assert stopped.traceback[-1].name != "_heed"
    assert not stop.requested(), "nor does it stop the next job"


def test_an_ignored_signal_stays_ignored() -> None:
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        with stop.heeded():
            os.kill(os.getpid(), signal.SIGINT)
        assert signal.getsignal(signal.SIGINT) is signal.SIG_IGN
    finally:
        signal.signal(signal.SIGINT, before)


def test_handlers_are_put_back() -> None:
    before = signal.getsignal(signal.SIGTERM)
    with stop.heeded():
        assert signal.getsignal(signal.SIGTERM) is not before
    assert signal.getsignal(signal.SIGTERM) is before


IN_A_LIBRARY = """
import _imp, signal, sys
from mtcsirl.cli import main

loading = False

def look(frame, event, called):
    global loading
    if event.startswith("c_") and called in (_imp.create_dynamic, _imp.exec_dynamic):
        loading = event == "c_call" and "mujoco._" in str(frame.f_locals["args"])
    elif event == "call" and loading:
        sys.setprofile(None)
        print("inside")
        signal.raise_signal(signal.SIGTERM)

sys.setprofile(look)
sys.exit(main(sys.argv[1:]))
"""


def test_a_signal_while_a_library_loads_is_no_bug(tmp_path: Path) -> None:
    """MuJoCo's own modules make an ImportError of what ends them."""
    command = [sys.executable, "-c", IN_A_LIBRARY, *train(tmp_path / "run")[3:]]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.stdout == "inside\n"
    assert done.returncode == 143
    says = "stopped by SIGTERM; the same command goes on from its last checkpoint, if it has one"
    assert done.stderr == f"mtcsirl: {says}\n"


WHILE_IT_LOADS = """
import signal, sys

class Finder:
    def find_spec(self, name, path=None, target=None):
        if name == sys.argv[1]:
            print("inside")
            signal.raise_signal(signal.SIGINT)

sys.meta_path.insert(0, Finder())
import mtcsirl.cli
"""


@pytest.mark.parametrize("module", ["argparse", "mtcsirl.commands.video", "pydantic"])
def test_ctrl_c_in_the_first_moment_shows_no_import(module: str) -> None:
    done = subprocess.run([sys.executable, "-c", WHILE_IT_LOADS, module], capture_output=True, text=True, check=False)
    assert (done.stdout, done.stderr, done.returncode) == ("inside\n", "", 130)
