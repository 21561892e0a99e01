"""What the controller is told of a Slurm that answers, is silent or forgets; and the cluster of the tests."""

import os
from pathlib import Path

import pytest

from mtcsirl import slurm
from mtcsirl.errors import UserError
from tests.cluster.slurm import Cluster, NotStartedError, lacking, main, started

pytestmark = pytest.mark.slow


class Waiting:
    """For jobs of these numbers."""

    def __init__(self, *numbers: str) -> None:
        self._numbers, self.taken_back = numbers, 0

    def numbers(self) -> tuple[str, ...]:
        return self._numbers

    def take_back(self) -> None:
        self.taken_back += 1


@pytest.fixture
def inside(cluster: Cluster, monkeypatch: pytest.MonkeyPatch) -> Cluster:
    """This process finds the cluster."""
    monkeypatch.setenv("SLURM_CONF", cluster.environment["SLURM_CONF"])
    return cluster


@pytest.fixture
def outside(cluster: Cluster, monkeypatch: pytest.MonkeyPatch) -> None:
    """The commands are there and no cluster."""
    monkeypatch.setattr(slurm, "PATIENCE", 3)
    monkeypatch.setenv("SLURM_CONF", "/nowhere/slurm.conf")


def test_squeue_answers_and_sacct_without_accounting_does_not(inside: Cluster) -> None:
    assert slurm.answering("squeue") == "squeue"
    with pytest.raises(UserError, match=r"sacct cannot see .* use --slurm-status-command squeue"):
        slurm.answering("sacct")


@pytest.mark.usefixtures("outside")
def test_no_cluster_is_one_line() -> None:
    with pytest.raises(UserError, match="squeue cannot see the jobs") as error:
        slurm.answering("squeue")
    assert str(error.value).count("\n") == 0


def test_a_slurm_that_forgets_jobs_too_soon_is_refused(inside: Cluster) -> None:
    with pytest.raises(UserError, match=r"forgets a job 1800 s after its end .* MinJobAge=3000"):
        slurm.answering("squeue", 1000)


def test_a_job_that_slurm_forgot_is_named_once_and_one_that_it_knows_never(inside: Cluster) -> None:
    job = inside.ask("sbatch", "--parsable", "--output=/dev/null", "--array=1-2", "--wrap=true").stdout.strip()
    said: list[str] = []
    watch = slurm.Watch("squeue", Waiting(f"{job}_1", f"{job}_2", "987654"), said.append)
    watch.look()
    assert said == [], "the answer may be older than the job"
    watch.look()
    watch.look()
    (line,) = said
    assert line.startswith("slurm: squeue no longer knows 987654, ")


def test_silence_and_its_end_are_said_once(inside: Cluster, monkeypatch: pytest.MonkeyPatch) -> None:
    said: list[str] = []
    waiting = Waiting()
    watch = slurm.Watch("squeue", waiting, said.append)
    watch.look()
    with monkeypatch.context() as away:
        away.setattr(slurm, "PATIENCE", 3)
        away.setenv("SLURM_CONF", "/nowhere/slurm.conf")
        watch.look()
        watch.look()
    watch.look()
    assert said[0].startswith("slurm: squeue cannot see the jobs (")
    assert said[1].startswith("slurm: squeue answers again")
    assert len(said) == 2
    assert waiting.taken_back == 2, "only where Slurm answers"


def test_a_command_that_is_not_there_is_silence(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PATH", "/nowhere")
    with pytest.raises(UserError, match="squeue: No such file or directory"):
        slurm.answering("sacct")


def test_what_is_not_installed_is_named() -> None:
    assert lacking("/nowhere") == "no Slurm here: apt-get install munge slurm-wlm"


def test_a_daemon_that_cannot_start_says_why_and_none_is_left(cluster: Cluster) -> None:
    with pytest.raises(NotStartedError, match="slurmctld does not start: "), started("SelectType=select/none_such\n"):
        pass
    others = [path for path in Path("/tmp").glob(f"slurm-{os.getpid()}-*/slurm.conf") if path.parent != cluster.folder]
    assert others == []


def test_a_command_runs_inside(cluster: Cluster, capfd: pytest.CaptureFixture[str]) -> None:
    assert main(["sh", "-c", "squeue && exit 7"]) == 7
    assert "JOBID" in capfd.readouterr().out
    assert os.environ.get("SLURM_CONF") is None
