"""The smoke DAG on a real Slurm, through profiles/slurm: to its end, through a scancel and through a time limit.

Both studies run side by side, as the second one mostly waits for its time limit.
"""

import re
import time
from collections.abc import Iterable
from pathlib import Path
from typing import NamedTuple

import pytest

from mtcsirl.settings import Settings
from mtcsirl.settings.loading import load
from mtcsirl.study.design import design
from mtcsirl.study.plan import Request, request
from mtcsirl.study.rates import load_rates
from tests.cluster.conftest import Controller, Controllers
from tests.cluster.slurm import Cluster, until

pytestmark = pytest.mark.slow
TABLE = "methods: [mt_csirl]\ncs_rewards: [velocity]\n"
LONG = "seeds: [0, 1, 2]\nbaseline: {steps: {default: 20000}}\nprogress: {checkpoint_every: 1000, select_every: 5000}\n"
"""Baselines of about ten seconds each, with a checkpoint every half second."""
CANCELLED, TIMED_OUT = "sac/reach-wall-t0/s0", "sac/reach-wall-t0/s1"
FIRST_LOOK = ("--slurm-init-seconds-before-status-checks", "12")
SHORT_JOBS = ("--slurm-array-jobs", "train_expert", "--groups", "collect_demonstrations=imitation",
              "learn_reward=imitation")  # fmt: skip


class Job(NamedTuple):
    """A job as squeue shows it; ``name``: its rule or group with the wildcards."""

    number: str
    megabytes: int
    minutes: int
    state: str
    name: str


class Studies(NamedTuple):
    """Both studies after their end."""

    table: Controller
    long: Controller
    jobs: list[Job]


def jobs(cluster: Cluster) -> list[Job]:
    said = cluster.ask("squeue", "--states=all", "--noheader", "--array", "--format=%i|%m|%l|%T|%k").stdout
    rows = [line.split("|") for line in said.splitlines()]
    return [Job(number, int(mem.rstrip("M")), minutes(limit), state, name) for number, mem, limit, state, name in rows]


def minutes(limit: str) -> int:
    """Of a limit as in 11:00 or 1:00:00."""
    *hours, own, _ = map(int, limit.split(":"))
    return own + 60 * sum(hours)


def with_checkpoint(cluster: Cluster, study: Controller, run: str) -> str:
    """The number of the job that trains ``run``, as soon as it has left a checkpoint."""
    seed = run[-1]
    checkpoint = study.folder / "results/cluster" / run / "checkpoint.safetensors"
    assert until(checkpoint.exists, 240), study.said()
    (job,) = [job for job in jobs(cluster) if f"rule_train_sac_wildcards_reach-wall_0_{seed}_" in job.name]
    return job.number


@pytest.fixture(scope="module")
def studies(cluster: Cluster, controllers: Controllers) -> Studies:
    limit = ("--set-resources", "train_sac:runtime=1 if attempt == 1 else 10")
    long = controllers(LONG, *FIRST_LOOK, *limit)
    long.start(long.target(CANCELLED), long.target(TIMED_OUT))
    # stopped, the one keeps its checkpoint and no core until its minute is over; the other is cancelled
    cluster.ask("scancel", "--signal=STOP", with_checkpoint(cluster, long, TIMED_OUT))
    cluster.ask("scancel", with_checkpoint(cluster, long, CANCELLED))
    table = controllers(TABLE, *FIRST_LOOK, *SHORT_JOBS).start("table_2")
    assert table.ended() == 0, table.said()
    assert long.ended() == 0, long.said()
    return Studies(table, long, jobs(cluster))


@pytest.fixture(scope="module")
def asked(studies: Studies) -> dict[str, Request]:
    """What the plan asks for, by stage; at this scale all runs of a stage are alike."""
    settings, rates = settings_of(studies.table), load_rates()
    return {run.stage: request(run, settings, rates) for run in design(settings, "table_2")}


def settings_of(study: Controller) -> Settings:
    return load((study.folder / "overlay.yaml",), (), "smoke")


def of(jobs: Iterable[Job], name: str) -> list[Job]:
    return [job for job in jobs if job.name.startswith(f"rule_{name}")]


def test_table_2_is_there(studies: Studies) -> None:
    assert (studies.table.folder / "results/cluster/tables/table_2.csv").stat().st_size > 0
    runs = list(design(settings_of(studies.table), "table_2"))
    assert f"{len(runs) + 1} of {len(runs) + 1} " in studies.table.said()


def test_each_run_asks_for_what_the_plan_says(studies: Studies, asked: dict[str, Request]) -> None:
    (transfer,) = of(studies.jobs, "transfer")
    assert (transfer.megabytes, transfer.minutes) == (asked["transfer"].mem_mb, asked["transfer"].minutes)
    (table,) = of(studies.jobs, "table_2")
    assert (table.megabytes, table.minutes) == (3000, 60)
    assert transfer.megabytes < table.megabytes


def test_an_array_is_one_submission(studies: Studies, asked: dict[str, Request]) -> None:
    experts = of(studies.jobs, "train_expert")
    assert len(experts) == 3
    assert len({job.number.partition("_")[0] for job in experts}) == 1
    assert {job.minutes for job in experts} == {asked["train_expert"].minutes}


def test_a_group_is_one_job(studies: Studies, asked: dict[str, Request]) -> None:
    (group,) = of(studies.jobs, "imitation")
    assert not of(studies.jobs, "collect_demonstrations") + of(studies.jobs, "learn_reward")
    assert group.minutes == asked["collect_demonstrations"].minutes + asked["learn_reward"].minutes


@pytest.mark.parametrize(("run", "state"), [(CANCELLED, "CANCELLED"), (TIMED_OUT, "TIMEOUT")])
def test_it_goes_on_from_its_checkpoint(studies: Studies, run: str, state: str) -> None:
    identity = studies.long.target(run).split(".")[-2]
    tries = [job for job in studies.jobs if job.name.endswith(identity)]
    first, second = sorted(tries, key=lambda job: int(job.number))
    assert (first.state, second.state) == (state, "COMPLETED")
    assert (first.minutes, second.minutes) == (1, 10)
    assert f"SLURM status is: '{state}'" in studies.long.said(), "the screen says why it failed"
    logs = (studies.long.folder / "results/cluster/logs" / run).glob("*.log")
    (step,) = re.findall(r"resumed at step (\d+)", "".join(log.read_text(encoding="utf-8") for log in logs))
    assert int(step) >= 1000
    folder = studies.long.folder / "results/cluster" / run
    assert (folder / "provenance.json").exists()
    assert not list(folder.glob("checkpoint*"))


def test_a_run_that_nobody_disturbs_resumes_nothing(studies: Studies) -> None:
    logs = (studies.table.folder / "results/cluster/logs").rglob("*.log")
    assert not [log for log in logs if "resumed" in log.read_text(encoding="utf-8")]


def test_a_controller_that_loses_sight_of_its_jobs_says_so(cluster: Cluster, controllers: Controllers) -> None:
    study = controllers(LONG, "--slurm-init-seconds-before-status-checks", "5")
    study.start(study.target("sac/reach-wall-t0/s2"))
    assert until(lambda: "has been submitted" in study.said(), 120), study.said()
    assert "cannot see the jobs" not in study.said()
    cluster.stop_controller()  # for longer than the plugin's first look, by which it would drop the job
    try:
        since = time.monotonic()
        assert until(lambda: "slurm: squeue cannot see the jobs" in study.said(), 60), study.said()
        print(f"said after {time.monotonic() - since:.0f} s")
    finally:
        cluster.start_controller()
    assert study.ended(400) == 0, study.said()
    assert "slurm: squeue answers again" in study.said()


def test_a_controller_that_could_never_see_its_jobs_does_not_start(cluster: Cluster, controllers: Controllers) -> None:
    study = controllers(TABLE, "--slurm-status-command", "sacct").start("table_1")
    assert study.ended() == 1
    (line,) = [line for line in study.said().splitlines() if line.startswith("slurm: ")]
    assert "sacct cannot see the jobs (Slurm accounting storage is disabled)" in line
    assert "use --slurm-status-command squeue" in line
    assert not Path(study.folder / "results/cluster/logs").exists()
