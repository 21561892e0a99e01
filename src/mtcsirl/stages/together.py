"""The agents of a study in lockstep: many in one process, at about two thirds of the cost of one job each.

What it leaves is what the DAG's jobs leave, byte for byte, so Snakemake goes on from it; so do their checkpoints: a
batch that is stopped can be taken up by jobs of one agent each, and they by a batch.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from contextlib import ExitStack, contextmanager
from itertools import groupby
from pathlib import Path

from mtcsirl.agents.finite import NotFiniteError
from mtcsirl.agents.jobs import AgentJob, common_settings
from mtcsirl.agents.training import train_agents
from mtcsirl.errors import UserError
from mtcsirl.files.provenance import Stopwatch
from mtcsirl.files.storage import locked, remove
from mtcsirl.rewards.learned import WEIGHTS
from mtcsirl.settings import Settings
from mtcsirl.stages.training import CHECKPOINT, expert_job, sac_job, sign, transfer_job
from mtcsirl.study.outputs import OUTPUTS
from mtcsirl.study.runs import Baseline, Expert, Run, Transfer

AgentRun = Expert | Baseline | Transfer


def job_of(run: AgentRun, settings: Settings, results: Path) -> AgentJob:
    """The training job of a run, as its stage makes it."""
    own = run.settings(settings)
    if isinstance(run, Baseline):
        return sac_job(own, run.task, run.target, run.seed)  # type: ignore[arg-type]
    if isinstance(run, Expert):
        return expert_job(own, run.task, run.target, run.cs_reward, run.seed)  # type: ignore[arg-type]
    return transfer_job(
        own,  # type: ignore[arg-type]
        results / run.irl.folder,
        run.task,
        run.target,
        run.irl.cs_reward,
        run.seed,
        learned_task_reward=run.learned_task_reward,
    )


def train_together(
    runs: Iterable[Run],
    settings: Settings,
    results: Path,
    *,
    most: int = 16,
    log: Callable[[str], None] = print,
) -> int:
    """Train the agents among ``runs`` that are missing below ``results`` and whose reward is there; returns how many.

    ``most``: agents in one batch. Agents that another process holds are left to it, so several of these calls share
    the work. Agents of a batch that is stopped go on from where they were, whichever call takes them up.
    """
    trained = 0
    for batch in _batches(runs, settings, results, most):
        with _held(batch, results) as free:
            if not free:
                continue
            log(f"{free[0].stage}: {', '.join(run.folder for run in free)}")
            _train(free, settings, results, log)
            trained += len(free)
    return trained


def _batches(runs: Iterable[Run], settings: Settings, results: Path, most: int) -> Iterator[list[AgentRun]]:
    """Agents of one stage that may train in lockstep, ``most`` at a time; looked for anew before every batch."""

    def together(run: AgentRun) -> tuple[str, str]:
        return run.stage, common_settings(run.settings(settings)).model_dump_json()  # type: ignore[arg-type]

    wanted = sorted((run for run in runs if isinstance(run, AgentRun)), key=together)
    for _, alike in groupby(wanted, key=together):
        rest = list(alike)
        while rest:
            missing = [run for run in rest if _missing(run, results)]
            batch, rest = missing[:most], missing[most:]
            if batch:
                yield batch


def _missing(run: AgentRun, results: Path) -> bool:
    ready = not isinstance(run, Transfer) or (results / run.irl.folder / WEIGHTS).is_file()
    return ready and not all((results / run.folder / name).is_file() for name in OUTPUTS[run.stage])


@contextmanager
def _held(batch: list[AgentRun], results: Path) -> Iterator[list[AgentRun]]:
    """Hold the folders of those of ``batch`` that no other process holds or has finished meanwhile."""
    free = []
    with ExitStack() as stack:
        for run in batch:
            try:
                stack.enter_context(locked(results / run.folder))
            except UserError:
                continue
            if _missing(run, results):
                free.append(run)
        yield free


def _train(batch: list[AgentRun], settings: Settings, results: Path, log: Callable[[str], None]) -> None:
    stopwatch = Stopwatch()
    jobs = [job_of(run, settings, results) for run in batch]
    checkpoints = [results / run.folder / CHECKPOINT for run in batch]
    try:
        trained = train_agents(jobs, checkpoints=checkpoints, log=log)
    except NotFiniteError as error:
        healthy = [run for index, run in enumerate(batch) if index not in error.agents]
        if healthy and len(healthy) < len(batch):
            log(f"{error}; going on without it")
            _train(healthy, settings, results, log)
        raise
    for run, agent, checkpoint in zip(batch, trained, checkpoints, strict=True):
        agent.save(results / run.folder)
        sign(results / run.folder, agent.job.settings, stopwatch, agent.job.inputs, agents=len(batch))
        remove(checkpoint)
