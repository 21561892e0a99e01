"""Stage ``train_expert``: SAC on r_task + C alpha r_cs; keeps the best policy by the expert's gate (appendix B)."""

from pathlib import Path

from mtcsirl.agents.jobs import AgentJob
from mtcsirl.rewards.adapter import ground_truth
from mtcsirl.settings.runs import AgentRunSettings
from mtcsirl.stages.agents import agent_task, train
from mtcsirl.study.runs import Expert


def expert_job(settings: AgentRunSettings, run: Expert) -> AgentJob:
    """The agent of ``run``."""
    f = ground_truth(run.cs_reward, settings.environment.observation)
    return AgentJob(run.task, run.target, run.seed, settings, run.cs_reward, f=f, gate="expert")


def train_expert(settings: AgentRunSettings, run: Expert, output: Path, *, wanted: str | None = None) -> None:
    """Train the expert ``run`` into the folder ``output``."""
    job = expert_job(settings, run)
    train(job, agent_task(run.stage, run.about, job, output, wanted))
