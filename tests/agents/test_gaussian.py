"""The squashed Gaussian: its density by numerical integration, its gradient by autograd."""

import math

import pytest
import torch
from stable_baselines3.common.distributions import SquashedDiagGaussianDistribution

from mtcsirl.agents.gaussian import squashed_log_prob, squashed_sample, squashed_sample_gradient

BOUNDS = (-20.0, 2.0)


@pytest.mark.parametrize(("mean", "log_std"), [(0.0, -1.0), (0.7, -1.5), (-0.4, -0.7)])
def test_density_integrates_to_the_normal_mass_between_the_clips(mean, log_std):
    actions = torch.linspace(-1 + 1e-3, 1 - 1e-3, 200_001, dtype=torch.float64)
    head = torch.tensor([mean, log_std], dtype=torch.float64).expand(len(actions), 2)
    density = squashed_log_prob(head, actions[:, None], *BOUNDS).exp()
    normal = torch.distributions.Normal(mean, math.exp(log_std))
    edge = torch.atanh(actions[[0, -1]])
    mass = normal.cdf(edge[1]) - normal.cdf(edge[0])
    assert torch.trapezoid(density, actions).item() == pytest.approx(mass.item(), abs=1e-5)


def test_density_of_four_actions_is_the_product_of_one():
    generator = torch.Generator().manual_seed(1)
    head, action = torch.randn(6, 8, generator=generator), torch.randn(6, 4, generator=generator).tanh()
    single = torch.stack([squashed_log_prob(head[:, [i, 4 + i]], action[:, [i]], *BOUNDS) for i in range(4)])
    torch.testing.assert_close(squashed_log_prob(head, action, *BOUNDS), single.sum(0))


def test_density_of_extreme_actions_is_that_of_the_clipped_ones():
    head = torch.zeros(1, 8)
    extreme = squashed_log_prob(head, torch.ones(1, 4), *BOUNDS)
    clipped = squashed_log_prob(head, torch.full((1, 4), 1 - 1e-3), *BOUNDS)
    assert torch.isfinite(extreme)
    assert torch.equal(extreme, clipped)


def test_sample_is_that_of_stable_baselines3():
    head = torch.randn(5, 8, generator=torch.Generator().manual_seed(0))
    assert head.max() < BOUNDS[1]
    torch.manual_seed(3)
    action, log_prob = SquashedDiagGaussianDistribution(4).log_prob_from_params(*head.chunk(2, dim=-1))
    torch.manual_seed(3)
    sample = squashed_sample(head, torch.normal(torch.zeros(5, 4), torch.ones(5, 4)), *BOUNDS)
    torch.testing.assert_close(sample.action, action)
    torch.testing.assert_close(sample.log_prob, log_prob)


def test_gradient_is_that_of_autograd_also_where_log_std_is_clamped():
    generator = torch.Generator().manual_seed(2)
    head = 2.0 * torch.randn(7, 8, generator=generator, dtype=torch.float64)
    noise = torch.randn(7, 4, generator=generator, dtype=torch.float64)
    action_weight = torch.randn(7, 4, generator=generator, dtype=torch.float64)
    log_prob_weight = torch.randn(7, generator=generator, dtype=torch.float64)
    bounds = (-1.0, 1.0)
    assert (head[:, 4:].abs() > 1.0).any()

    leaf = head.clone().requires_grad_()
    mean, log_std = leaf.chunk(2, dim=-1)
    pre_squash = mean + log_std.clamp(*bounds).exp() * noise
    action = torch.tanh(pre_squash)
    density = -0.5 * noise.square() - log_std.clamp(*bounds) - torch.log(1 - action.square() + 1e-6)
    ((action * action_weight).sum() + (density.sum(-1) * log_prob_weight).sum()).backward()

    sample = squashed_sample(head, noise, *bounds)
    ours = squashed_sample_gradient(sample, action_weight, log_prob_weight[:, None])
    torch.testing.assert_close(ours, leaf.grad)
