"""Logit, loss and update of our discriminator against those that imitation's AIRL gave for the same batch.

imitation cannot be installed beside this suite. Its numbers were recorded by

    sh benchmarks/peer_environment.sh imitation
    build/imitation/bin/python benchmarks/imitation_airl.py record tests/data/imitation.json
"""

import json
from pathlib import Path

import pytest
import torch
from torch import Tensor

from mtcsirl.agents.sac import FusedSac
from mtcsirl.irl.discriminator import Batch, Discriminator
from mtcsirl.irl.losses import Adversarial, entire_reward_logit
from mtcsirl.rewards.networks import RewardNetwork
from mtcsirl.settings import LearnerSettings, RewardScaleSettings
from mtcsirl.transitions import Transitions

RECORDED = json.loads((Path(__file__).parents[1] / "data" / "imitation.json").read_text())
REWARD_LAYERS = ("mlp.dense0", "mlp.dense1", "mlp.dense_final")


def _recorded(*keys: str) -> Tensor:
    value = RECORDED
    for key in keys:
        value = value[key]
    return torch.tensor(value)


def _reward_parameters(which: str) -> Tensor:
    """imitation's reward network as our parameters [1, P]: weights transposed, each followed by its bias."""
    parts = [(_recorded(which, f"{layer}.weight").T, _recorded(which, f"{layer}.bias")) for layer in REWARD_LAYERS]
    return torch.cat([part.reshape(-1) for layer in parts for part in layer]).unsqueeze(0)


def _sac() -> FusedSac:
    """Our learner with the weights of imitation's policy: two hidden layers, then mean and log_std side by side."""
    settings = RewardScaleSettings().sac(LearnerSettings(hidden_sizes=tuple(RECORDED["sac_hidden_sizes"])))
    sac = FusedSac(1, settings, seeds=[0])
    heads = [torch.cat([_recorded("policy_weights", f"{head}.{kind}") for head in ("mu", "log_std")])
             for kind in ("weight", "bias")]  # fmt: skip
    layers = [[_recorded("policy_weights", f"latent_pi.{at}.{kind}") for kind in ("weight", "bias")] for at in (0, 2)]
    for layer, (weight, bias) in enumerate([*layers, heads]):
        sac.actor.weights[layer][0], sac.actor.biases[layer][0] = weight, bias
    return sac


@pytest.fixture
def discriminator() -> Discriminator:
    architecture = {
        "kind": "perceptron", "observation_size": 39, "action_size": 4, "hidden_sizes": RECORDED["hidden_sizes"],
        "output_scale": 1.0, "shaping": False, "discount": 0.99,
    }  # fmt: skip
    network = RewardNetwork.from_parameters(architecture, _reward_parameters("reward_weights"))
    loss = Adversarial(entire_reward_logit)
    return Discriminator(network, loss, RECORDED["learning_rate"], torch.Generator().manual_seed(0))


@pytest.fixture
def batch() -> Batch:
    state, action, following = (_recorded(name) for name in ("observation", "action", "next_observation"))
    sides = [Transitions(state[i : i + 1], action[i : i + 1], following[i : i + 1], torch.zeros(1, 12)) for i in (0, 1)]
    sac = _sac()
    log_pi = [sac.log_prob(side.observation, side.action).clone() for side in sides]
    return Batch(sides[0], sides[1], log_pi[0], log_pi[1], torch.ones(1, 1))


def test_log_pi_equals_imitations(batch) -> None:
    ours = torch.cat((batch.expert_log_pi, batch.generator_log_pi))
    torch.testing.assert_close(ours, _recorded("log_pi"), rtol=1e-5, atol=1e-5)


def test_logits_equal_imitations(discriminator, batch) -> None:
    ours = torch.cat(discriminator.logits(batch))
    torch.testing.assert_close(ours, _recorded("logit"), rtol=1e-5, atol=1e-5)
    assert ours.std() > 0.1, "a batch that tells logits apart"


def test_loss_is_twice_imitations_which_averages_over_both_sides(discriminator, batch) -> None:
    loss = discriminator.loss(discriminator.forward(batch))
    assert loss.item() == pytest.approx(2 * RECORDED["loss"], rel=1e-5)


def test_the_first_update_equals_imitations(discriminator, batch) -> None:
    """Adam's first step does not see the factor two of the loss."""
    before = discriminator.network.parameters.detach().clone()
    discriminator.update(batch)
    moved = discriminator.network.parameters.detach() - before
    theirs = _reward_parameters("reward_weights_after_one_update") - _reward_parameters("reward_weights")
    torch.testing.assert_close(moved, theirs, rtol=1e-3, atol=1e-6)
    assert (moved.abs() > 0.5 * RECORDED["learning_rate"]).float().mean() > 0.5


def test_the_comparison_notices_a_wrong_logit(discriminator, batch) -> None:
    wrong = batch._replace(expert_log_pi=-batch.expert_log_pi, generator_log_pi=-batch.generator_log_pi)
    assert not torch.allclose(torch.cat(discriminator.logits(wrong)), _recorded("logit"), atol=0.1)
