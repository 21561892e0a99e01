"""The learner and stable-baselines3's SAC, given the same batches and noise, hold the same parameters.

Both compute in double precision: what rounds otherwise in float32 grows to some 1e-5 in a hundred steps of Adam, and
libraries round otherwise on every kind of processor.
"""

from collections.abc import Iterator

import gymnasium
import numpy as np
import pytest
import stable_baselines3
import torch
from stable_baselines3.common.buffers import ReplayBuffer
from stable_baselines3.common.logger import Logger
from stable_baselines3.common.torch_layers import FlattenExtractor

from mtcsirl.agents.reference import copy_from_sb3
from mtcsirl.agents.sac import FusedSac
from mtcsirl.settings import SacSettings

OBSERVATION, ACTION, MINIBATCH, UPDATES = 39, 4, 64, 100


class Spaces(gymnasium.Env):
    observation_space = gymnasium.spaces.Box(-np.inf, np.inf, (OBSERVATION,), np.float32)
    action_space = gymnasium.spaces.Box(-1.0, 1.0, (ACTION,), np.float32)


class Doubled(FlattenExtractor):
    """Observations in double precision: stable-baselines3 turns them into float32."""

    def forward(self, observations: torch.Tensor) -> torch.Tensor:
        return super().forward(observations).double()


def filled_buffer(model: stable_baselines3.SAC, rows: int) -> ReplayBuffer:
    random = np.random.default_rng(0)
    for _ in range(rows):
        observation, following = random.standard_normal((2, 1, OBSERVATION), np.float32)
        action = random.uniform(-1, 1, (1, ACTION))
        reward = random.uniform(0, 10, 1)
        model.replay_buffer.add(observation, following, action, reward, np.zeros(1), [{}])
    return model.replay_buffer


@pytest.fixture
def _double() -> Iterator[None]:
    torch.set_default_dtype(torch.float64)
    yield
    torch.set_default_dtype(torch.float32)


@pytest.mark.usefixtures("_double")
@pytest.mark.parametrize("temperature", ["automatic", 0.5])
def test_same_parameters_after_100_updates(temperature):
    settings = SacSettings(
        temperature=temperature,
        initial_temperature=0.3,
        minibatch=MINIBATCH,
        policy_learning_rate=3e-4,
        critic_learning_rate=3e-4,
        temperature_learning_rate=3e-4,
        discount=0.99,
        polyak=5e-3,
    )
    model = stable_baselines3.SAC(
        "MlpPolicy",
        Spaces(),
        buffer_size=1000,
        learning_rate=3e-4,
        gamma=0.99,
        tau=5e-3,
        ent_coef="auto_0.3" if temperature == "automatic" else temperature,
        policy_kwargs={"net_arch": [256, 256], "features_extractor_class": Doubled},
        seed=3,
        device="cpu",
    )
    model.set_logger(Logger(folder=None, output_formats=[]))
    buffer = filled_buffer(model, 1000)
    learner = FusedSac(1, settings, seeds=[0], dtype=torch.float64)
    copy_from_sb3(model, learner)

    for step in range(UPDATES):
        # Seeding both random streams before each update makes the reference's rows and noise known.
        np.random.seed(step)  # noqa: NPY002
        torch.manual_seed(step)
        model.train(1, MINIBATCH)
        np.random.seed(step)  # noqa: NPY002
        rows = buffer.sample(MINIBATCH)
        torch.manual_seed(step)
        shape = (MINIBATCH, ACTION)
        noise = torch.stack([torch.normal(torch.zeros(shape), torch.ones(shape)) for _ in range(2)])
        learner.update(
            rows.observations[None].double(),
            rows.actions[None].double(),
            rows.rewards[None, :, 0].double(),
            rows.next_observations[None].double(),
            noise[None],
        )

    reference = FusedSac(1, settings, seeds=[1], dtype=torch.float64)
    copy_from_sb3(model, reference)
    for name in ("actor", "critics", "target_critics"):
        ours, theirs = (getattr(one, name).parameters for one in (learner, reference))
        assert (ours - theirs).norm() <= 1e-8 * theirs.norm(), name
    torch.testing.assert_close(learner.temperature, reference.temperature, rtol=1e-8, atol=0)
