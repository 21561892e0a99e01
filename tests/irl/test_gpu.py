"""On a GPU: the same tests on a machine that has one, and everywhere tensors that only claim to be on one."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import torch
from scipy import stats

from mtcsirl.agents.jobs import AgentJob
from mtcsirl.agents.training import Training, train_agents
from mtcsirl.irl.resume import load_state, state
from mtcsirl.irl.run import learn_reward, make_trainer
from mtcsirl.rewards.learned import LearnedReward, load_learned_reward
from mtcsirl.rewards.networks import RewardNetwork
from mtcsirl.settings.loading import load
from mtcsirl.settings.runs import AgentRunSettings, IrlRunSettings, baseline_run
from tests.claimed_device import ClaimedGpu, WrongDeviceError, on_gpu
from tests.irl.conftest import irl_settings

needs_gpu = pytest.mark.skipif(not torch.cuda.is_available(), reason="needs a CUDA device")
SEEDS, STEPS, ENDS = range(10), 5_000, 3
"""Agents on each device, their budget, and how many of their last episodes count."""


def on_cuda(settings: IrlRunSettings | AgentRunSettings) -> IrlRunSettings | AgentRunSettings:
    return settings.model_copy(update={"sac": settings.sac.model_copy(update={"device": "cuda"})})


def a_reward(seed: int = 0) -> LearnedReward:
    architecture = {
        "kind": "perceptron",
        "observation_size": 39,
        "action_size": 4,
        "hidden_sizes": [8],
        "output_scale": 1.0,
        "shaping": False,
    }
    network = RewardNetwork(architecture, random=torch.Generator().manual_seed(seed))
    return LearnedReward(network, "mt_csirl", "velocity", "mapped", (("reach", 0),))


@pytest.mark.parametrize("method", ["mt_csirl", "mt_vairl", "mt_csirl_lt"])
def test_irl_keeps_its_tensors_on_the_device_of_its_settings(
    demonstrations: list[Path], method: str, claimed_gpu: ClaimedGpu
) -> None:
    settings = on_cuda(irl_settings())
    with claimed_gpu:
        trainer = make_trainer(method, "velocity", demonstrations, 0, settings)
        for _ in range(2):
            trainer.iterate()
        kept = {name: tensor.clone().cpu() for name, tensor in state(trainer).items()}
        load_state(trainer, kept)
        trainer.iterate()
        assert all(on_gpu(network.parameters) for network in networks(trainer))
    trainer.world.environments.close()


def networks(trainer) -> list[RewardNetwork]:
    return [discriminator.network for discriminator in trainer.method.discriminators.values()]


def test_new_agents_keep_their_reward_on_the_device_of_their_settings(
    small_run: AgentRunSettings, claimed_gpu: ClaimedGpu
) -> None:
    own = on_cuda(small_run)
    with claimed_gpu:
        training = Training([AgentJob("reach", 0, seed, own, f=a_reward(seed).to("cuda")) for seed in (0, 1)])
        training.episode()
        training.episode()
        training.episode()
        assert training.learner.updates > 0
    training.close()


def test_a_reward_that_stayed_behind_is_found(small_run: AgentRunSettings, claimed_gpu: ClaimedGpu) -> None:
    with claimed_gpu:
        training = Training([AgentJob("reach", 0, 0, on_cuda(small_run), f=a_reward())])
        training.episode()
        training.episode()
        with pytest.raises(WrongDeviceError, match="both devices"):
            training.episode()
    training.close()


@needs_gpu
def test_ten_agents_learn_on_a_gpu_what_they_learn_on_a_processor() -> None:
    """The means of their last episodes differ by no more than chance, and both are far above where they began."""
    first, last = zip(*(rewards(device) for device in ("cpu", "cuda")), strict=True)
    difference = stats.ttest_ind(*last, equal_var=False).confidence_interval(0.99)
    assert difference.low < 0 < difference.high, (first, last)
    assert all(np.mean(end) > 1.5 * np.mean(start) for start, end in zip(first, last, strict=True)), (first, last)


def rewards(device: str) -> tuple[list[float], list[float]]:
    """Mean task reward of each agent's first and last episodes."""
    settings = baseline_run(load(overrides=[f"sac.device={device}"]), "reach").model_copy(update={"steps": STEPS})
    trained = train_agents([AgentJob("reach", 0, seed, settings) for seed in SEEDS], log=lambda line: None)
    curves = [one.curve[one.curve["metric"] == "task_reward"]["value"] for one in trained]
    return [float(curve.head(ENDS).mean()) for curve in curves], [float(curve.tail(ENDS).mean()) for curve in curves]


@needs_gpu
def test_a_reward_learned_on_a_gpu_trains_agents_there_and_on_a_processor(
    demonstrations: list[Path], small_run: AgentRunSettings, tmp_path: Path
) -> None:
    learn_reward(tmp_path, "mt_csirl", "velocity", demonstrations, 0, on_cuda(irl_settings()))
    curve = pd.read_csv(tmp_path / "curve.csv")
    assert np.isfinite(curve["value"]).all()
    assert (curve["metric"] == "task_reward").any()
    learned = load_learned_reward(tmp_path)
    for settings, f in ((small_run, learned), (on_cuda(small_run), learned.to("cuda"))):
        (trained,) = train_agents([AgentJob("reach", 0, 0, settings, f=f)], log=lambda line: None)
        assert np.isfinite(trained.curve["value"]).all()
