"""Logits and losses of the discriminators: pure functions, and combinators that build a method's loss from them.

Equation numbers are those of the paper. A discriminator D = exp(g) / (exp(g) + pi) has the logit
log D - log(1 - D) = g - log pi, so that log D = -softplus(-logit) and log(1 - D) = -softplus(logit).
"""

from __future__ import annotations

from collections.abc import Callable
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


def bottleneck_information(mean: Tensor, log_std: Tensor) -> Tensor:
    """KL(N(mean, std^2) || N(0, 1)) in nats, summed over z; [..., Z] -> [...].

    Sum over z of (mean^2 + std^2 - 1) / 2 - log std. Source: Peng et al. (2018), equation 4, and their code.
    """
    return 0.5 * (mean.square() + torch.exp(2.0 * log_std) - 1.0 - 2.0 * log_std).sum(-1)


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


class Loss:
    """A loss [T] of a pass [T, B]; parts with a state of their own update it after each step."""

    def __call__(self, forward: Pass) -> Tensor:
        """The loss of each task [T]."""
        raise NotImplementedError

    def logits(self, forward: Pass) -> tuple[Tensor, Tensor]:
        """The discriminator's logits of expert and generator [T, B]."""
        raise NotImplementedError

    def after_update(self, forward: Pass) -> None:
        """Called once after each step on the network's parameters."""

    def metrics(self) -> dict[str, float]:
        """What the loss has to report of its own state."""
        return {}

    def state(self) -> dict[str, Tensor]:
        """Tensors that a checkpoint needs (not copies)."""
        return {}


class Adversarial(Loss):
    """Equations 4 and 7 with one of the logits above."""

    def __init__(self, logit: Logit) -> None:
        self._logit = logit

    def logits(self, forward: Pass) -> tuple[Tensor, Tensor]:
        """The discriminator's logits of expert and generator [T, B]."""
        network, tau = forward.network, forward.temperature
        return tuple(  # type: ignore[return-value]
            self._logit(network.shaped(output), side.task_reward, side.log_pi, tau)
            for side, output in (
                (forward.expert, forward.expert_output),
                (forward.generator, forward.generator_output),
            )
        )

    def __call__(self, forward: Pass) -> Tensor:
        """The cross entropy of each task [T]."""
        return cross_entropy(*self.logits(forward))


class _Wrapped(Loss):
    """A loss on top of another: everything not overridden is the inner loss's."""

    def __init__(self, inner: Loss) -> None:
        self.inner = inner

    def logits(self, forward: Pass) -> tuple[Tensor, Tensor]:
        """The inner loss's logits."""
        return self.inner.logits(forward)

    def after_update(self, forward: Pass) -> None:
        """Hand on to the inner loss."""
        self.inner.after_update(forward)

    def metrics(self) -> dict[str, float]:
        """The inner loss's report."""
        return self.inner.metrics()

    def state(self) -> dict[str, Tensor]:
        """The inner loss's tensors."""
        return self.inner.state()


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


class GradientPenalty(_Wrapped):
    """inner + weight E ||grad_x f(x) / output_scale||^2: on the unscaled network, so that its size has one meaning."""

    def __init__(self, inner: Loss, weight: float, points: PenaltyPoints) -> None:
        super().__init__(inner)
        self._weight, self._points = weight, points

    def __call__(self, forward: Pass) -> Tensor:
        """The penalised loss of each task [T]."""
        inputs = self._points(forward).detach().requires_grad_()
        value = forward.network.output(inputs, forward.random).value
        return self.inner(forward) + self._weight * gradient_penalty(value, inputs)


class InformationBottleneck(_Wrapped):
    """inner + beta (E[KL(E(z|x) || N(0, 1))] - I_c) with dual ascent on beta; Peng et al. (2018), equations 5 to 9.

    The expectation runs over expert and generator samples in equal parts. ``step`` = 0 keeps beta fixed.
    """

    def __init__(self, inner: Loss, constraint: float, beta: float, step: float) -> None:
        super().__init__(inner)
        self._constraint, self._step = constraint, step
        self.beta = torch.tensor(beta)
        self.information = torch.zeros(())

    @staticmethod
    def _information(forward: Pass) -> Tensor:
        both = (forward.expert_output.information, forward.generator_output.information)
        return 0.5 * (both[0].mean(-1) + both[1].mean(-1))

    def __call__(self, forward: Pass) -> Tensor:
        """The constrained loss of each task [T]."""
        return self.inner(forward) + self.beta * (self._information(forward) - self._constraint)

    def after_update(self, forward: Pass) -> None:
        """One dual step on beta, with the KL averaged over tasks."""
        super().after_update(forward)
        self.information.copy_(self._information(forward).detach().mean())
        self.beta.copy_(dual_step(self.beta, self.information, self._constraint, self._step))

    def metrics(self) -> dict[str, float]:
        """Multiplier and KL (nats)."""
        return {**self.inner.metrics(), "beta": float(self.beta), "kl": float(self.information)}

    def state(self) -> dict[str, Tensor]:
        """Multiplier and last KL."""
        return {**self.inner.state(), "beta": self.beta, "information": self.information}
