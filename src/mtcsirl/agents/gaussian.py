"""The squashed Gaussian policy: a = tanh(u), u ~ N(mu(s), sigma(s)^2), as in Haarnoja et al. (2018), appendix C."""

from __future__ import annotations

import math
from typing import NamedTuple

import torch
from torch import Tensor

SQUASH_EPSILON = 1e-6
"""Inside the logarithm of the change of variables; the value stable-baselines3 has."""

ACTION_MARGIN = 1e-3
"""Given actions are clipped to +-(1 - this) before their density is taken; at |a| = 1 it would be infinite."""

_HALF_LOG_TWO_PI = 0.5 * math.log(2.0 * math.pi)


class SquashedSample(NamedTuple):
    """Actions drawn with their log density, and what the gradient needs. All [..., action] but log_prob [...]."""

    action: Tensor
    log_prob: Tensor
    deviation: Tensor
    """sigma x noise, which is du / d log_std."""
    slope: Tensor
    """da / du = 1 - a^2."""
    inside: Tensor
    """Whether log_std lies inside its bounds and so has a gradient."""


def squashed_sample(head: Tensor, noise: Tensor, min_log_std: float, max_log_std: float) -> SquashedSample:
    """Draw a = tanh(mu + sigma x noise) from the network's output head = (mu, log_std), [..., 2 x action].

    log pi(a|s) = sum_i [ -noise_i^2 / 2 - log_std_i - log(2 pi) / 2 - log(1 - a_i^2 + 1e-6) ].
    """
    mean, raw_log_std = head.chunk(2, dim=-1)
    log_std = raw_log_std.clamp(min_log_std, max_log_std)
    deviation = log_std.exp().mul_(noise)
    action = torch.add(mean, deviation).tanh_()
    slope = action.square().neg_().add_(1.0)
    negative_density = torch.add(slope, SQUASH_EPSILON).log_().add_(log_std).addcmul_(noise, noise, value=0.5)
    log_prob = negative_density.sum(-1).add_(_HALF_LOG_TWO_PI * action.shape[-1]).neg_()
    return SquashedSample(action, log_prob, deviation, slope, log_std == raw_log_std)


def squashed_sample_gradient(sample: SquashedSample, action_gradient: Tensor, log_prob_gradient: Tensor) -> Tensor:
    """dL/d head [..., 2 x action], given dL/d action [..., action] and dL/d log_prob [..., 1].

    dL/du = (dL/da + dL/dlogp x 2 a / (1 - a^2 + 1e-6)) (1 - a^2);
    dL/dmu = dL/du;  dL/dlog_std = dL/du x sigma x noise - dL/dlogp, where log_std is not clamped.
    """
    correction = torch.div(sample.action, sample.slope + SQUASH_EPSILON)
    mean_gradient = torch.addcmul(action_gradient, correction, log_prob_gradient, value=2.0).mul_(sample.slope)
    log_std_gradient = torch.mul(mean_gradient, sample.deviation).sub_(log_prob_gradient).mul_(sample.inside)
    return torch.cat((mean_gradient, log_std_gradient), dim=-1)


def squashed_log_prob(head: Tensor, action: Tensor, min_log_std: float, max_log_std: float) -> Tensor:
    """log pi(a|s) [...] of given actions [..., action], clipped to +-(1 - 1e-3) so that it stays finite."""
    mean, log_std = head.chunk(2, dim=-1)
    log_std = log_std.clamp(min_log_std, max_log_std)
    action = action.clamp(ACTION_MARGIN - 1.0, 1.0 - ACTION_MARGIN)
    noise = (torch.atanh(action) - mean) * torch.exp(-log_std)
    density = -0.5 * noise.square() - log_std - torch.log(1.0 - action.square() + SQUASH_EPSILON)
    return density.sum(-1) - _HALF_LOG_TWO_PI * action.shape[-1]
