"""Stage ``train_sac``: the baseline, SAC on r_task alone."""

from pathlib import Path

from mtcsirl.agents.jobs import AgentJob
from mtcsirl.settings.runs import AgentRunSettings
from mtcsirl.stages.agents import agent_task, train
from mtcsirl.study.runs import Baseline


def sac_job(settings: AgentRunSettings, run: Baseline) -> AgentJob:
    """The agent of ``run``."""
    return AgentJob(run.task, run.target, run.seed, settings)


def train_sac(settings: AgentRunSettings, run: Baseline, output: Path, *, wanted: str | None = None) -> None:
    """Train the baseline ``run`` into the folder ``output``."""
    job = sac_job(settings, run)
    train(job, agent_task(run.stage, run.about, job, output, wanted))
