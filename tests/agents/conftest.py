"""Small settings and random batches for the tests of the agents."""

import pytest
import torch

from mtcsirl.settings import SacSettings
from mtcsirl.settings.runs import AgentRunSettings


@pytest.fixture(autouse=True)
def _one_thread():
    torch.set_num_threads(1)


@pytest.fixture
def small_sac() -> SacSettings:
    return SacSettings(hidden_sizes=(16, 16), minibatch=32, random_steps=100, updates_per_step=0.1)


@pytest.fixture
def small_run() -> AgentRunSettings:
    return AgentRunSettings(
        steps=300,
        cs_weight=2.0,
        curriculum=True,
        sac={"hidden_sizes": (16, 16), "minibatch": 32, "random_steps": 100, "updates_per_step": 0.2},
        evaluation={"episodes": 2, "episode_steps": 50},
        progress={"checkpoint_every": 100, "select_every": 100, "select_episodes": 1},
    )
