"""Killed or stopped anywhere, started again, a run ends with the bytes of one that nobody disturbed."""

import json
import os
import random
import signal
import time
from pathlib import Path

import pytest

from mtcsirl.files import storage
from tests.faults.harness import LONG, Stage, contents, ended, fork, seconds_of

pytestmark = pytest.mark.slow

ENDINGS = {signal.SIGKILL: -9, signal.SIGTERM: 143, signal.SIGINT: 130}
TRIES = 30 if LONG else 2


@pytest.mark.parametrize("number", ENDINGS, ids=lambda number: number.name)
def test_at_random_moments(stage: Stage, tmp_path: Path, number: signal.Signals) -> None:
    whole, random_ = tmp_path / "whole", random.Random(number)
    seconds = seconds_of(lambda: stage(whole))
    codes = set()
    for index in range(TRIES):
        folder = tmp_path / str(index)
        child = fork(lambda folder=folder: stage(folder))
        time.sleep(random_.uniform(0.1, 0.95) * seconds)
        os.kill(child, number)
        codes.add(ended(child))
        assert ended(fork(lambda folder=folder: stage(folder))) == 0
        assert contents(folder) == contents(whole)
    assert codes <= {0, ENDINGS[number]}


EVENTS = ("fsync", "replace", "unlink")


def _dies_at(event: int, stage: Stage, folder: Path) -> None:
    """Do the stage, and die before the file event of that number, or after it (odd numbers)."""
    count = [0]

    def dying(original):
        def call(*arguments, **options):
            for after in (False, True):
                if count[0] == event:
                    os.kill(os.getpid(), signal.SIGKILL)
                count[0] += 1
                result = None if after else original(*arguments, **options)
                if not after:
                    kept = result
            return kept

        return call

    for name in EVENTS:
        setattr(os, name, dying(getattr(os, name)))
    stage(folder)
    (folder.parent / "events").write_text(str(count[0]))


def test_at_every_file_event_of_a_run(stage: Stage, tmp_path: Path) -> None:
    """Before and after every fsync, rename and removal: results, settings, provenance, checkpoints, the lock."""
    whole = tmp_path / "whole"
    assert ended(fork(lambda: _dies_at(-1, stage, whole))) == 0
    assert {path.name for path in whole.glob("*")} >= {"settings.json", "provenance.json"}
    assert not list(whole.glob("checkpoint*"))
    events = int((tmp_path / "events").read_text())
    print(f"{events} events")
    assert events > 30, "the harness sees what the run does"
    chosen = range(events) if LONG else sorted(random.Random(0).sample(range(events), 8))
    for event in chosen:
        folder = tmp_path / f"event {event}"
        assert ended(fork(lambda event=event, folder=folder: _dies_at(event, stage, folder))) == -9
        trained = (folder / "curve.csv").exists()
        assert not trained or _finished(folder) or list(folder.glob("checkpoint*")), "no training is lost at its end"
        assert ended(fork(lambda folder=folder: stage(folder))) == 0
        assert contents(folder) == contents(whole), "and neither a temporary nor a lock is left"


def _finished(folder: Path) -> bool:
    return (folder / "provenance.json").exists()


def test_the_harness_notices_a_run_that_loses_its_training(stage: Stage, tmp_path: Path) -> None:
    """A stage that drops its checkpoint before its results stand is what the test above looks for."""
    folder = tmp_path / "run"

    def hasty(place: Path) -> None:
        write = storage.write_csv

        def writes(path: Path, frame: object) -> None:
            for checkpoint in place.glob("checkpoint*"):
                checkpoint.unlink()
            write(path, frame)
            os.kill(os.getpid(), signal.SIGKILL)

        storage.write_csv = writes
        import mtcsirl.irl.run as run

        run.write_csv = writes
        stage(place)

    assert ended(fork(lambda: hasty(folder))) == -9
    assert (folder / "curve.csv").exists()
    assert not list(folder.glob("checkpoint*"))


def test_cost_adds_up_over_tries(stage: Stage, tmp_path: Path) -> None:
    folder = tmp_path / "run"

    def slow(place: Path) -> None:
        fsync = os.fsync
        os.fsync = lambda handle: (time.sleep(0.3), fsync(handle))[1]
        stage(place)

    child = fork(lambda: slow(folder))
    while not list(folder.glob("checkpoint*")):
        time.sleep(0.01)
    time.sleep(1.0)  # another checkpoint or two
    os.kill(child, signal.SIGTERM)
    assert ended(child) == 143
    (checkpoint,) = folder.glob("checkpoint*")
    notes = json.loads(storage.read_tensors(checkpoint)["notes"].numpy().tobytes())
    own = seconds_of(lambda: stage(folder))
    spent = storage.read_json(folder / "provenance.json")["cost"]["wall_seconds"]
    assert notes["spent"]["wall_seconds"] > 1.0
    assert notes["spent"]["wall_seconds"] < spent <= notes["spent"]["wall_seconds"] + own
