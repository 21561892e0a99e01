"""Logits, penalties and the loss of the discriminators: functions, from which a method's loss is put together.

Equation numbers are those of the paper. A discriminator D = exp(g) / (exp(g) + pi) has the logit
log D - log(1 - D) = g - log pi, so that log D = -softplus(-logit) and log(1 - D) = -softplus(logit).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import torch
from torch import Tensor
from torch.nn.functional import softplus

if TYPE_CHECKING:
    from mtcsirl.rewards.networks import Output, RewardNetwork

Logit = Callable[[Tensor, Tensor, Tensor, Tensor], Tensor]
"""(f, r_task, log pi, temperature) -> logit, all broadcastable to [T, B]."""


def entire_reward_logit(f: Tensor, task_reward: Tensor, log_pi: Tensor, temperature: Tensor) -> Tensor:
    """Equations 1, 3, 8 and 9: f learns the entire reward (or, in 8, the task reward of task t).

    logit = f(s, a, s') / tau - log pi(a|s); the paper has tau = 1. ``task_reward`` is not used.
    """
    return f / temperature - log_pi


def known_task_reward_logit(f: Tensor, task_reward: Tensor, log_pi: Tensor, temperature: Tensor) -> Tensor:
    """Equation 6: the task reward is known, f is left with the common-sense reward.

    logit = (f(s, a, s') + r_t(s, a, s')) / tau - log pi_t(a|s); the paper has tau = 1.
    """
    return (f + task_reward) / temperature - log_pi


def cross_entropy(expert_logit: Tensor, generator_logit: Tensor) -> Tensor:
    """Equations 4 and 7: L = -E_D[log D] - E_pi[log(1 - D)], means over the minibatch; [..., B] -> [...]."""
    return softplus(-expert_logit).mean(-1) + softplus(generator_logit).mean(-1)


def clamp_log_pi(log_pi: Tensor, limit: float) -> Tensor:
    """Clamp log pi to +-limit nats: squashed densities are unbounded and would saturate D (any shape)."""
    return log_pi.clamp(-limit, limit)


def dual_step(beta: Tensor, information: Tensor, constraint: float, step: float) -> Tensor:
    """beta <- max(0, beta + step (KL - I_c)); Peng et al. (2018), equation 9. All scalars; KL and I_c in nats."""
    return (beta + step * (information - constraint)).clamp(min=0.0)


def gradient_penalty(value: Tensor, inputs: Tensor) -> Tensor:
    """E ||d value / d inputs||^2, the zero-centred penalty; value [..., B], inputs [..., B, I] -> [...].

    ``value`` must depend on its own row of ``inputs`` only. Differentiable. Source: Peng et al. (2018), section 4,
    after Mescheder et al. (2018).
    """
    (gradient,) = torch.autograd.grad(value.sum(), inputs, create_graph=True)
    return gradient.square().sum(-1).mean(-1)


class Points(NamedTuple):
    """One side of a minibatch. ``inputs`` [T, B, I]; the rest [T, B] or broadcastable to it."""

    inputs: Tensor
    task_reward: Tensor
    log_pi: Tensor


class Pass(NamedTuple):
    """One forward pass of a discriminator over a minibatch: what every part of a loss may read."""

    network: RewardNetwork
    expert: Points
    generator: Points
    temperature: Tensor
    """Entropy temperature of the generators, broadcastable to [T, B]; ones where the logit is as printed."""
    expert_output: Output
    generator_output: Output
    random: torch.Generator


Penalty = Callable[[Pass], Tensor]
"""What is added to the loss of each task: a pass [T, B] -> [T]."""
PenaltyPoints = Callable[[Pass], Tensor]
"""Where a gradient penalty is taken: a pass -> inputs [T, B, I]."""


def expert_points(forward: Pass) -> Tensor:
    """The expert's samples: the penalty of VAIRL-GP (Peng et al., 2018)."""
    return forward.expert.inputs


def interpolated_points(forward: Pass) -> Tensor:
    """x = e x_expert + (1 - e) x_generator with e ~ U(0, 1) per pair (Gulrajani et al., 2017)."""
    expert, generator = forward.expert.inputs, forward.generator.inputs
    share = torch.rand(expert.shape[:-1], generator=forward.random, device=expert.device).unsqueeze(-1)
    return generator + share * (expert - generator)


def gradient_penalty_at(points: PenaltyPoints, weight: float) -> Penalty:
    """weight E ||grad_x f(x) / output_scale||^2: on the unscaled network, so that its size has one meaning."""

    def penalty(forward: Pass) -> Tensor:
        inputs = points(forward).detach().requires_grad_()
        value = forward.network.output(inputs, forward.random).value
        return weight * gradient_penalty(value, inputs)

    return penalty


class InformationBottleneck:
    """beta (E[KL(E(z|x) || N(0, 1))] - I_c) with dual ascent on beta; Peng et al. (2018), equations 5 to 9.

    The expectation runs over expert and generator samples in equal parts. ``step`` = 0 keeps beta fixed.
    """

    def __init__(self, constraint: float, beta: float, step: float) -> None:
        self._constraint, self._step = constraint, step
        self.beta = torch.tensor(beta)
        self.information = torch.zeros(())

    @staticmethod
    def _information(forward: Pass) -> Tensor:
        both = (forward.expert_output.information, forward.generator_output.information)
        return 0.5 * (both[0].mean(-1) + both[1].mean(-1))

    def __call__(self, forward: Pass) -> Tensor:
        """The penalty of each task [T]."""
        return self.beta * (self._information(forward) - self._constraint)

    def after_update(self, forward: Pass) -> None:
        """One dual step on beta, with the KL averaged over tasks."""
        self.information.copy_(self._information(forward).detach().mean())
        self.beta.copy_(dual_step(self.beta, self.information, self._constraint, self._step))

    def state(self) -> dict[str, Tensor]:
        """Multiplier and last KL (not copies)."""
        return {"beta": self.beta, "kl": self.information}


@dataclass(frozen=True)
class Adversarial:
    """The loss of a discriminator: equation 4 or 7 with one of the logits above, and what is added to it."""

    logit: Logit
    bottleneck: InformationBottleneck | None = None
    penalties: tuple[Penalty, ...] = ()

    def logits(self, forward: Pass) -> tuple[Tensor, Tensor]:
        """The discriminator's logits of expert and generator [T, B]."""

        def of(side: Points, output: Output) -> Tensor:
            return self.logit(forward.network.shaped(output), side.task_reward, side.log_pi, forward.temperature)

        return of(forward.expert, forward.expert_output), of(forward.generator, forward.generator_output)

    def __call__(self, forward: Pass) -> Tensor:
        """The loss of each task [T]."""
        added = [penalty(forward) for penalty in self.penalties]
        loss = cross_entropy(*self.logits(forward))
        if self.bottleneck is not None:
            loss = loss + self.bottleneck(forward)
        return sum(added, loss)

    def after_update(self, forward: Pass) -> None:
        """Called once after each step on the network's parameters."""
        if self.bottleneck is not None:
            self.bottleneck.after_update(forward)

    def state(self) -> dict[str, Tensor]:
        """Its own tensors, which a checkpoint needs and diagnostics report (not copies)."""
        return {} if self.bottleneck is None else self.bottleneck.state()
