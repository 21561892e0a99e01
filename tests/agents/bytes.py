"""Runs of agents as the bytes that they leave, and runs that are stopped."""

from collections.abc import Sequence
from pathlib import Path

import pytest

from mtcsirl.agents.jobs import AgentJob
from mtcsirl.agents.training import Training, train_agents

WRITTEN = ("curve.csv", "evaluation.csv", "gate.json", "policy.json", "policy.safetensors")


class KilledError(Exception):
    """Stands for SIGKILL."""


def run(jobs: Sequence[AgentJob], folder: Path, **options) -> list[dict[str, bytes]]:
    """Train and save; the bytes of everything written, by agent."""
    agents = train_agents(jobs, **({"log": lambda line: None} | options))
    for index, agent in enumerate(agents):
        agent.save(folder / str(index))
    return [{name: (folder / str(index) / name).read_bytes() for name in WRITTEN} for index in range(len(agents))]


def killed_at(step: int, jobs: Sequence[AgentJob], checkpoints: Sequence[Path]) -> None:
    """Train until so many steps are made; the checkpoints remain."""
    killed = Training(jobs, checkpoints=checkpoints, log=lambda line: None)
    original = killed.environments.step

    def counted(action):
        if killed.step == step:
            raise KilledError
        return original(action)

    killed.environments.step = counted
    with pytest.raises(KilledError):
        killed.run()
    killed.close()
