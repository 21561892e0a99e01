"""The agents of a study in lockstep: many in one process, at about two thirds of the cost of one job each.

A batch is invisible in what it leaves: an agent has the bytes and the identity of one that its stage trains alone.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import replace
from functools import singledispatch
from itertools import groupby
from pathlib import Path

from mtcsirl.agents.finite import NotFiniteError
from mtcsirl.agents.jobs import AgentJob, common_settings
from mtcsirl.agents.training import train_agents
from mtcsirl.errors import UserError
from mtcsirl.files import storage
from mtcsirl.files.provenance import Stopwatch
from mtcsirl.settings import Settings
from mtcsirl.stages.agents import agent_task
from mtcsirl.stages.running import CHECKPOINT, Input, Task, begin, sign
from mtcsirl.stages.train_expert import expert_job
from mtcsirl.stages.train_sac import sac_job
from mtcsirl.stages.transfer import NewAgent, reward_input, transfer_job
from mtcsirl.study.runs import AgentRun, AnyRun, Baseline, Expert, Transfer
from mtcsirl.study.standing import DONE, standing


@singledispatch
def job_of(run: AnyRun, settings: Settings, results: Path) -> tuple[AgentJob, dict[str, object], dict[str, Input]]:
    """The training job of a run as its stage makes it, what its identity says of it, and its inputs."""
    raise TypeError(f"{run.stage} trains no single agent")


@job_of.register
def _(run: Expert, settings: Settings, results: Path) -> tuple[AgentJob, dict[str, object], dict[str, Input]]:
    return expert_job(run.settings(settings), run), run.about, {}


@job_of.register
def _(run: Baseline, settings: Settings, results: Path) -> tuple[AgentJob, dict[str, object], dict[str, Input]]:
    return sac_job(run.settings(settings), run), run.about, {}


@job_of.register
def _(run: Transfer, settings: Settings, results: Path) -> tuple[AgentJob, dict[str, object], dict[str, Input]]:
    agent, reward = NewAgent(**run.about), results / run.irl.folder
    return transfer_job(run.settings(settings), reward, agent), agent.about(), reward_input(reward)


def train_together(
    runs: Iterable[AgentRun],
    settings: Settings,
    results: Path,
    *,
    most: int = 16,
    workers: int = 0,
    log: Callable[[str], None] = print,
) -> int:
    """Train the agents among ``runs`` that are not done below ``results`` and whose reward is; returns how many.

    ``most``: agents in one batch; ``workers``: processes that step the environments. Agents that another process holds
    are left to it, so several of these calls share the work. An agent that is stopped goes on from its own checkpoint,
    in whatever company.
    """
    trained = 0
    for batch in _batches(runs, settings, results, most):
        with _held(batch, settings, results) as free:
            if not free:
                continue
            log(f"{free[0].stage}: {', '.join(run.folder for run in free)}")
            _train(free, settings, results, workers, log)
            trained += len(free)
    return trained


def _batches(runs: Iterable[AgentRun], settings: Settings, results: Path, most: int) -> Iterator[list[AgentRun]]:
    """Agents of one stage that may train in lockstep, ``most`` at a time; looked for anew before every batch."""

    def together(run: AgentRun) -> tuple[str, str]:
        return run.stage, common_settings(run.settings(settings)).model_dump_json()

    for _, alike in groupby(sorted(runs, key=together), key=together):
        rest = list(alike)
        while rest:
            missing = [run for run in rest if _missing(run, settings, results)]
            batch, rest = missing[:most], missing[most:]
            if batch:
                yield batch


def _missing(run: AgentRun, settings: Settings, results: Path) -> bool:
    """Whether a run is still to be done and everything that it reads is there."""
    ready = all(standing(needed, settings, results).state == DONE for needed in run.needs.values())
    return ready and standing(run, settings, results).state != DONE


@contextmanager
def _held(batch: list[AgentRun], settings: Settings, results: Path) -> Iterator[list[AgentRun]]:
    """Hold the folders of those of ``batch`` that no other process holds or has finished meanwhile."""
    free = []
    with ExitStack() as stack:
        for run in batch:
            try:
                stack.enter_context(storage.locked(results / run.folder))
            except UserError:
                continue
            if _missing(run, settings, results):
                free.append(run)
        yield free


def _train(batch: list[AgentRun], settings: Settings, results: Path, workers: int, log: Callable[[str], None]) -> None:
    stopwatch = Stopwatch()
    tasks: list[Task] = []
    jobs: list[AgentJob] = []
    for run in batch:
        job, about, inputs = job_of(run, settings, results)
        tasks.append(agent_task(run.stage, about, job, results / run.folder, None, inputs))
        jobs.append(replace(job, made_from=tasks[-1].identity.hash))
        begin(tasks[-1])
    checkpoints = [task.output / CHECKPOINT for task in tasks]
    try:
        trained = train_agents(jobs, checkpoints=checkpoints, stopwatch=stopwatch, log=log, workers=workers)
    except NotFiniteError as error:
        healthy = [run for index, run in enumerate(batch) if index not in error.agents]
        if healthy and len(healthy) < len(batch):
            log(f"{error}; going on without it")
            _train(healthy, settings, results, workers, log)
        raise
    for agent, task in zip(trained, tasks, strict=True):
        agent.save(task.output)
        sign(task, stopwatch, agents=len(batch), lockstep=agent.lockstep)
