"""What the three stages that train one agent share."""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

from mtcsirl.agents.jobs import AgentJob
from mtcsirl.agents.training import train_agents
from mtcsirl.stages.running import CHECKPOINT, Input, Task, running
from mtcsirl.study.keys import identity


def agent_task(
    stage: str,
    about: Mapping[str, object],
    job: AgentJob,
    output: Path,
    wanted: str | None,
    inputs: Mapping[str, Input] | None = None,
) -> Task:
    """The task of training ``job`` into the folder ``output``."""
    inputs = inputs or {}
    made_from = identity(stage, about, job.settings, {role: one.hash for role, one in inputs.items()})
    read = {role: one.bytes for role, one in inputs.items()}
    return Task(made_from, job.settings, output, read, job.inputs, wanted)


def train(job: AgentJob, task: Task) -> None:
    """Train one agent."""
    with running(task) as stopwatch:
        if stopwatch is not None:
            events = task.output / "events" if job.settings.progress.tensorboard else None
            (agent,) = train_agents(
                [replace(job, made_from=task.identity.hash)],
                checkpoints=[task.output / CHECKPOINT],
                stopwatch=stopwatch,
                events=events,
            )
            agent.save(task.output)
