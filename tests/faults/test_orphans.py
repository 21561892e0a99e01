"""Snakemake killed while a job runs: its orphan goes on; started again, Snakemake neither repeats nor loses it."""

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import suppress
from pathlib import Path

import pytest

from mtcsirl.files.identity import marker
from mtcsirl.settings.loading import load
from mtcsirl.study.keys import identity_of
from mtcsirl.study.runs import Baseline
from tests.faults.harness import contents

pytestmark = [pytest.mark.dag, pytest.mark.xdist_group("orphans")]
RUN = Baseline("reach-wall", 0, 0)
OVERLAY = """
baseline: {steps: {default: 3000}}
progress: {checkpoint_every: 1000}
evaluation: {episodes: 1, episode_steps: 100}
"""
PATIENCE = 100
"""Seconds until a test gives up."""


class Workflow:
    """Snakemake in a folder of its own, asked for one run."""

    def __init__(self, checkout: Path, place: Path) -> None:
        overlay = place / "overlay.yaml"
        overlay.write_text(OVERLAY)
        files = [checkout / "config/smoke.yaml", overlay]
        settings = load(files)
        name = identity_of(RUN, settings).hash
        self.place, self.folder = place, place / settings.results / RUN.folder
        self.marker = self.folder / marker(name)
        self._logs = place / settings.results / "logs" / RUN.folder
        self._target = str(self.marker.relative_to(place))
        self._words = [sys.executable, "-m", "snakemake", "--snakefile", str(checkout / "Snakefile")]
        self._words += ["--configfile", *map(str, files), "--cores", "1"]

    def start(self, *words: str) -> subprocess.Popen[bytes]:
        """Snakemake, asked for the marker of the run; what it prints goes to a file, which an orphan may keep open."""
        with open(self.place / "said", "wb") as said:
            command = [*self._words, *words, "--", self._target]
            return subprocess.Popen(command, cwd=self.place, stdout=said, stderr=subprocess.STDOUT)

    def said(self) -> str:
        """What the Snakemake that was started last has printed."""
        return (self.place / "said").read_text()

    def done(self, *words: str) -> str:
        """What Snakemake prints until it has ended well."""
        return self.ended(self.start(*words))

    def ended(self, job: subprocess.Popen[bytes], code: int = 0) -> str:
        """What Snakemake has printed when it ends."""
        assert job.wait(PATIENCE) == code, self.said()
        return self.said()

    def wait_for(self, true: Callable[[], bool], job: subprocess.Popen[bytes]) -> None:
        """Until ``true``, which must become so while ``job`` runs."""
        start = time.monotonic()
        while not true():
            assert job.poll() is None, self.said()
            assert time.monotonic() - start < PATIENCE, self.said()
            time.sleep(0.02)

    def orphaned(self) -> int:
        """The pid of a halted job whose Snakemake was killed after the job's first checkpoint."""
        job = self.start()
        self.wait_for((self.folder / "checkpoint.safetensors").exists, job)
        orphan = self.holder()
        os.kill(orphan, signal.SIGSTOP)
        job.kill()
        self.ended(job, -signal.SIGKILL)
        assert not self.marker.exists()
        return orphan

    def holder(self) -> int:
        """The pid of the process that works in the run's folder."""
        return int((self.folder / ".lock").read_text().split()[0])

    def logged(self) -> str:
        """What all tries of the run have said, in no order."""
        said = []
        for path in self._logs.glob("*.log"):
            with suppress(FileNotFoundError):  # Snakemake removes the one and a job names the other
                said.append(path.read_text())
        return "".join(said)


@pytest.fixture
def workflow(checkout: Path, tmp_path: Path) -> Iterator[Workflow]:
    """A workflow; what still works in its folder when a test fails is killed."""
    flow = Workflow(checkout, tmp_path)
    yield flow
    with suppress(OSError):
        os.kill(flow.holder(), signal.SIGKILL)


@pytest.fixture(scope="module")
def undisturbed(checkout: Path, tmp_path_factory: pytest.TempPathFactory) -> Workflow:
    """A workflow whose run is done."""
    flow = Workflow(checkout, tmp_path_factory.mktemp("whole"))
    flow.done()
    assert not any(words in flow.logged() for words in ("waiting", "resumed", "already there"))
    return flow


@pytest.fixture(scope="module")
def whole(undisturbed: Workflow) -> dict[str, bytes]:
    """The files of a run that nobody disturbed."""
    return contents(undisturbed.folder)


def test_a_new_job_waits_for_the_orphan_and_takes_what_it_leaves(workflow: Workflow, whole: dict[str, bytes]) -> None:
    orphan = workflow.orphaned()
    workflow.done("--unlock")
    job = workflow.start()
    workflow.wait_for(lambda: "waiting for another process" in workflow.logged(), job)
    assert workflow.holder() == orphan
    os.kill(orphan, signal.SIGCONT)
    workflow.ended(job)
    assert "already there, made from the same" in workflow.logged()
    assert "resumed" not in workflow.logged(), "no second training"
    assert "step 3000/3000" in workflow.logged(), "the orphan's log stays"
    assert contents(workflow.folder) == whole


def test_an_orphan_that_ends_before_snakemake_is_started_again(workflow: Workflow, whole: dict[str, bytes]) -> None:
    orphan = workflow.orphaned()
    os.kill(orphan, signal.SIGCONT)
    start = time.monotonic()
    while (workflow.folder / ".lock").exists():
        assert time.monotonic() - start < PATIENCE
        time.sleep(0.02)
    left = {path: path.stat().st_ino for path in workflow.folder.iterdir() if not path.name.startswith(".")}
    workflow.done("--nolock")
    assert {path: path.stat().st_ino for path in left} == left, "nothing was written again"
    assert contents(workflow.folder) == whole


def test_where_the_orphan_dies_too_the_run_goes_on_from_its_checkpoint(
    workflow: Workflow, whole: dict[str, bytes]
) -> None:
    os.kill(workflow.orphaned(), signal.SIGKILL)
    workflow.done("--nolock")
    assert "resumed at step" in workflow.logged()
    assert "already there" not in workflow.logged()
    assert contents(workflow.folder) == whole


def test_touching_does_not_hide_what_is_lost(undisturbed: Workflow, whole: dict[str, bytes]) -> None:
    (undisturbed.folder / "evaluation.csv").unlink()
    undisturbed.done("--touch")
    undisturbed.done()
    assert contents(undisturbed.folder) == whole, "made again"
