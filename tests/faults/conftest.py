"""The two kinds of run that can be killed: an agent and an IRL run, each of a second."""

from pathlib import Path

import pytest

from mtcsirl.settings.runs import AgentRunSettings
from mtcsirl.stages.learn_reward import Learning, learn_reward
from mtcsirl.stages.train_expert import train_expert
from mtcsirl.study.runs import Expert
from tests.faults.harness import Stage
from tests.irl.conftest import demonstrations as demonstrations
from tests.irl.conftest import irl_settings


def _agent(small_run: AgentRunSettings, demonstrations: list[Path]) -> Stage:
    settings = small_run.model_copy(update={"steps": 1000})
    return lambda folder: train_expert(settings, Expert("velocity", "reach", 1, 0), folder)


def _irl(small_run: AgentRunSettings, demonstrations: list[Path]) -> Stage:
    settings = irl_settings(iterations=6)
    learning = Learning("multi_task", "mt_csirl", "velocity", "all", 100)
    return lambda folder: learn_reward(settings, learning, demonstrations, folder)


@pytest.fixture(params=[_agent, _irl], ids=["agent", "irl"])
def stage(request: pytest.FixtureRequest, small_run: AgentRunSettings, demonstrations: list[Path]) -> Stage:
    """What fills the folder of a run."""
    return request.param(small_run, demonstrations)
