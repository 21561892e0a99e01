"""Logits and losses against numbers worked out by hand."""

import math
from dataclasses import replace

import pytest
import torch

from mtcsirl.irl.discriminator import Batch, Discriminator
from mtcsirl.irl.losses import (
    Adversarial,
    InformationBottleneck,
    Pass,
    Points,
    clamp_log_pi,
    cross_entropy,
    dual_step,
    entire_reward_logit,
    expert_points,
    gradient_penalty,
    interpolated_points,
    known_task_reward_logit,
)
from mtcsirl.irl.methods.base import penalised
from mtcsirl.irl.methods.mt_csirl_lt import half_of_entire_reward_logit
from mtcsirl.rewards.networks import Output, RewardNetwork, bottleneck_information
from mtcsirl.transitions import Transitions

ONE = torch.ones(1, 1)


@pytest.fixture(autouse=True)
def _same_numbers_every_time() -> None:
    torch.manual_seed(0)


def test_logits_are_the_log_odds_of_the_printed_discriminators() -> None:
    f, reward, log_pi = (torch.tensor([[value]]) for value in (0.5, 2.0, -1.5))
    # Equation 1: D = e^f / (e^f + pi) with e^0.5 = 1.6487, pi = e^-1.5 = 0.2231: log D/(1-D) = log(1.6487/0.2231) = 2.
    assert entire_reward_logit(f, reward, log_pi, ONE).item() == pytest.approx(2.0)
    # Equation 6: the numerator is e^(0.5 + 2): the logit is 2.5 + 1.5 = 4.
    assert known_task_reward_logit(f, reward, log_pi, ONE).item() == pytest.approx(4.0)


@pytest.mark.parametrize(
    ("logit", "expected"),
    [
        (entire_reward_logit, 0.5 / 0.25 + 1.5),
        (known_task_reward_logit, (0.5 + 2.0) / 0.25 + 1.5),
        (half_of_entire_reward_logit, 0.5 / 0.125 + 1.5),
    ],
)
def test_rewards_but_not_log_pi_are_divided_by_the_temperature(logit, expected) -> None:
    f, reward, log_pi = (torch.tensor([[value]]) for value in (0.5, 2.0, -1.5))
    assert logit(f, reward, log_pi, 0.25 * ONE).item() == pytest.approx(expected)


def test_discriminator_probability_equals_the_printed_fraction() -> None:
    f, reward, log_pi = torch.randn(3, 5), 10 * torch.rand(3, 5), torch.randn(3, 5)
    printed = torch.exp(f + reward) / (torch.exp(f + reward) + torch.exp(log_pi))
    ours = torch.sigmoid(known_task_reward_logit(f, reward, log_pi, torch.ones(3, 1)))
    torch.testing.assert_close(ours, printed)


def test_cross_entropy_by_hand() -> None:
    # D = 1/2 everywhere costs 2 log 2. D = 0.9 on experts and 0.2 on generators: -log 0.9 - log 0.8 = 0.328504.
    zeros = torch.zeros(1, 4)
    assert cross_entropy(zeros, zeros).item() == pytest.approx(2 * math.log(2))
    expert, generator = torch.full((1, 4), math.log(9.0)), torch.full((1, 4), math.log(0.25))
    assert cross_entropy(expert, generator).item() == pytest.approx(0.328504, abs=1e-6)


def test_cross_entropy_is_finite_where_the_discriminator_is_certain() -> None:
    loss = cross_entropy(torch.tensor([[-1000.0]]), torch.tensor([[1000.0]]))
    assert loss.item() == pytest.approx(2000.0)


def test_clamped_log_pi() -> None:
    assert clamp_log_pi(torch.tensor([-95_000.0, -3.0, 40.0]), 10.0).tolist() == [-10.0, -3.0, 10.0]


def test_bottleneck_information_by_hand_and_by_monte_carlo() -> None:
    # z1 ~ N(1, 1): 1/2. z2 ~ N(0, 2^2): (4 - 1)/2 - log 2 = 0.806853. Sum 1.306853 nats.
    mean, log_std = torch.tensor([[1.0, 0.0]]), torch.tensor([[0.0, math.log(2.0)]])
    closed = bottleneck_information(mean, log_std)
    assert closed.item() == pytest.approx(1.306853, abs=1e-6)
    encoder = torch.distributions.Normal(mean, log_std.exp())
    torch.manual_seed(0)
    z = encoder.sample((400_000,))
    estimate = (encoder.log_prob(z) - torch.distributions.Normal(0.0, 1.0).log_prob(z)).sum(-1).mean()
    assert closed.item() == pytest.approx(estimate.item(), abs=0.01)


def test_gradients_of_the_bottlenecks_kl_equal_finite_differences() -> None:
    mean, log_std = torch.randn(2, 3, 4, dtype=torch.float64), 0.5 * torch.randn(2, 3, 4, dtype=torch.float64)
    inputs = (mean.requires_grad_(), log_std.requires_grad_())
    assert torch.autograd.gradcheck(bottleneck_information, inputs)
    (slope,) = torch.autograd.grad(bottleneck_information(*inputs).sum(), inputs[:1])
    torch.testing.assert_close(slope, mean.detach())  # d/dmean of mean^2 / 2


def test_dual_step_rises_above_the_constraint_falls_below_and_stops_at_zero() -> None:
    beta = torch.tensor(0.3)
    assert dual_step(beta, torch.tensor(2.5), 0.5, 0.1).item() == pytest.approx(0.5)
    assert dual_step(beta, torch.tensor(0.0), 0.5, 0.1).item() == pytest.approx(0.25)
    assert dual_step(beta, torch.tensor(0.0), 0.5, 1.0).item() == 0.0


def test_gradient_penalty_by_hand() -> None:
    # g(x) = 3 x1 + x2^2 at (., 2) and (., 0): gradients (3, 4) and (3, 0): mean of 25 and 9.
    inputs = torch.tensor([[[7.0, 2.0], [1.0, 0.0]]], requires_grad=True)
    value = 3 * inputs[..., 0] + inputs[..., 1] ** 2
    assert gradient_penalty(value, inputs).tolist() == [17.0]


def _network(kind: str = "perceptron", members: int = 1, **extra) -> RewardNetwork:
    architecture = {
        "kind": kind,
        "observation_size": 3,
        "action_size": 2,
        "hidden_sizes": [8, 8],
        "bottleneck_size": 4,
        "output_scale": 10.0,
        "shaping": False,
        "discount": 0.9,
        **extra,
    }
    return RewardNetwork(architecture, members, torch.Generator().manual_seed(3))


def _transitions(*shape: int) -> Transitions:
    return Transitions(torch.randn(*shape, 3), torch.randn(*shape, 2), torch.randn(*shape, 3), torch.rand(*shape))


def _batch(tasks: int, minibatch: int) -> Batch:
    sides = [_transitions(tasks, minibatch) for _ in range(2)]
    log_pis = [torch.randn(tasks, minibatch) for _ in range(2)]
    return Batch(*sides, *log_pis, torch.ones(tasks, 1))


def _penalty(network: RewardNetwork, x: torch.Tensor) -> float:
    """E ||grad||^2 by central differences in float64."""
    network.parameters = network.parameters.detach().double()
    total, step = 0.0, 1e-5
    for column in range(x.shape[-1]):
        shift = torch.zeros(x.shape[-1], dtype=torch.float64)
        shift[column] = step
        slope = (network.output(x + shift).value - network.output(x - shift).value) / (2 * step)
        total += slope.square().mean().item()
    return total


def test_gradient_penalty_of_a_network_equals_finite_differences() -> None:
    network = _network()
    inputs = torch.randn(1, 32, 8, requires_grad=True)
    ours = gradient_penalty(network.output(inputs).value, inputs).item()
    assert ours == pytest.approx(_penalty(network, inputs.detach().double()), rel=1e-4)


@pytest.mark.parametrize("kind", ["perceptron", "bottleneck"])
def test_gradients_of_the_penalty_in_the_parameters_equal_finite_differences(kind) -> None:
    """The second derivative, which an update descends."""
    network = _network(kind)
    x, random = torch.randn(1, 8, 8, dtype=torch.float64), torch.Generator().manual_seed(5)
    parameters = network.parameters.detach().double()

    def penalty(values: torch.Tensor) -> torch.Tensor:
        network.parameters = values
        inputs = x.clone().requires_grad_()
        return gradient_penalty(network.output(inputs).value, inputs).sum()

    (gradient,) = torch.autograd.grad(penalty(given := parameters.clone().requires_grad_()), given)
    for _ in range(5):
        direction = torch.randn(parameters.shape, generator=random, dtype=torch.float64)
        with torch.enable_grad():
            difference = (penalty(parameters + 1e-6 * direction) - penalty(parameters - 1e-6 * direction)) / 2e-6
        assert (gradient * direction).sum().item() == pytest.approx(difference.item(), rel=1e-4)


def test_penalised_loss_adds_weight_times_the_penalty_at_the_experts() -> None:
    network, batch = _network(), _batch(2, 16)
    plain = Adversarial(known_task_reward_logit)
    forward = Discriminator(network, plain, 1e-3, torch.Generator().manual_seed(0)).forward(batch)
    extra = penalised(plain, 0.5, expert_points)(forward) - plain(forward)
    assert penalised(plain, 0.0, expert_points) == plain
    expected = [0.5 * _penalty(_network(), forward.expert.inputs[t : t + 1].double()) for t in range(2)]
    assert extra.tolist() == pytest.approx(expected, rel=1e-3)


def test_interpolates_lie_between_expert_and_generator() -> None:
    zero, one = torch.zeros(1, 1000, 3), torch.ones(1, 1000, 3)
    sides = [Points(side, torch.zeros(1, 1000), torch.zeros(1, 1000)) for side in (one, zero)]
    nothing = Output(zero, zero, zero)
    forward = Pass(_network(), *sides, torch.ones(1, 1), nothing, nothing, torch.Generator().manual_seed(0))
    share = interpolated_points(forward)
    assert torch.equal(share[..., 0], share[..., 2])  # one share per pair
    assert 0.0 <= share.min() < 0.01
    assert 0.99 < share.max() < 1.0
    assert share.mean().item() == pytest.approx(0.5, abs=0.05)


def test_bottleneck_adds_beta_times_the_excess_of_the_mean_kl() -> None:
    network, batch = _network("bottleneck"), _batch(2, 16)
    plain = Adversarial(entire_reward_logit)
    loss = replace(plain, bottleneck=InformationBottleneck(constraint=0.5, beta=2.0, step=0.25))
    forward = Discriminator(network, loss, 1e-3, torch.Generator().manual_seed(0)).forward(batch)
    kls = forward._replace(
        expert_output=forward.expert_output._replace(information=torch.tensor([[1.0, 3.0], [0.0, 0.0]])),
        generator_output=forward.generator_output._replace(information=torch.tensor([[4.0, 4.0], [0.0, 2.0]])),
    )
    # Mean KL of the two tasks: (2 + 4)/2 = 3 and (0 + 1)/2 = 0.5.
    extra = loss(kls) - plain(kls)
    assert extra.tolist() == pytest.approx([2.0 * 2.5, 0.0], abs=1e-5)
    loss.after_update(kls)  # averaged over tasks 1.75: beta + 0.25 (1.75 - 0.5)
    assert {name: value.item() for name, value in loss.state().items()} == pytest.approx({"beta": 2.3125, "kl": 1.75})


def test_update_descends_the_sum_of_the_tasks_losses() -> None:
    torch.manual_seed(1)
    batch, loss = _batch(2, 64), Adversarial(known_task_reward_logit)
    discriminator = Discriminator(_network(), loss, 1e-2, torch.Generator().manual_seed(0))
    before = loss(discriminator.forward(batch)).sum().item()
    for _ in range(20):
        discriminator.update(batch)
    assert loss(discriminator.forward(batch)).sum().item() < 0.8 * before


def test_networks_of_one_task_each_step_as_if_alone() -> None:
    torch.manual_seed(2)
    batch, loss = _batch(3, 32), Adversarial(entire_reward_logit)
    together = Discriminator(_network(members=3), loss, 1e-2, torch.Generator().manual_seed(0))
    alone = [Discriminator(together.network.member(t), loss, 1e-2, torch.Generator().manual_seed(0)) for t in range(3)]
    for _ in range(5):
        together.update(batch)
        for task, discriminator in enumerate(alone):
            discriminator.update(batch.only(task))
    separate = torch.cat([discriminator.network.parameters for discriminator in alone])
    torch.testing.assert_close(together.network.parameters, separate, rtol=1e-5, atol=1e-6)
