"""The two kinds of run that can be killed: an agent and an IRL run, each of a second."""

from pathlib import Path

import pytest

from mtcsirl.settings.runs import AgentRunSettings
from mtcsirl.stages import training as stages
from tests.faults.harness import Stage
from tests.irl.conftest import demonstrations as demonstrations
from tests.irl.conftest import irl_settings


def _agent(small_run: AgentRunSettings, demonstrations: list[Path]) -> Stage:
    settings = small_run.model_copy(update={"steps": 1000})
    return lambda folder: stages.train(stages.expert_job(settings, "reach", 1, "velocity", 0), folder)


def _irl(small_run: AgentRunSettings, demonstrations: list[Path]) -> Stage:
    settings = irl_settings(iterations=6)
    return lambda folder: stages.learn_reward(settings, "mt_csirl", "velocity", demonstrations, 100, folder)


@pytest.fixture(params=[_agent, _irl], ids=["agent", "irl"])
def stage(request: pytest.FixtureRequest, small_run: AgentRunSettings, demonstrations: list[Path]) -> Stage:
    """What fills the folder of a run."""
    return request.param(small_run, demonstrations)
