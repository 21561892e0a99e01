"""The learned reward f(s, a, s') as a neural network; K of them with one tensor of parameters.

K = 1 is a reward that all tasks share: leading dimensions are arbitrary. K = T is one reward per task: inputs then
lead with T. Forward passes are plain torch operations on ``parameters`` [K, P], so that gradients of any order work.
"""

import itertools
import math
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import torch
from torch import Tensor

from mtcsirl.errors import UserError
from mtcsirl.transitions import Transitions

HEAD_BOUND = 0.01
"""The bottleneck's mean and log std start uniform within +- this, as in the VDB authors' code."""


class Output(NamedTuple):
    """What a network computes in training, all [..., B] or broadcastable to it."""

    value: Tensor
    """f / output_scale."""
    potential: Tensor
    """gamma h(s') - h(s), 0 without shaping."""
    information: Tensor
    """KL of the bottleneck in nats, 0 without one."""


def bottleneck_information(mean: Tensor, log_std: Tensor) -> Tensor:
    """KL(N(mean, std^2) || N(0, 1)) in nats, summed over z; [..., Z] -> [...].

    Sum over z of (mean^2 + std^2 - 1) / 2 - log std. Source: Peng et al. (2018), equation 4, and their code.
    """
    return 0.5 * (mean.square() + torch.exp(2.0 * log_std) - 1.0 - 2.0 * log_std).sum(-1)


class Layers:
    """The shape of a ReLU perceptron; its weights live in a flat tensor [K, count]."""

    def __init__(self, sizes: Sequence[int], bound: float | None = None) -> None:
        """``sizes``: inputs, hidden layers, outputs. ``bound``: initial range; default 1 / sqrt(fan in)."""
        self._shapes = list(itertools.pairwise(sizes))
        self._bound = bound
        self.count = sum((fan_in + 1) * fan_out for fan_in, fan_out in self._shapes)

    def initial(self, members: int, random: torch.Generator) -> Tensor:
        """Draw weights and biases [K, count] as torch.nn.Linear does: uniform in +-1 / sqrt(fan in)."""
        parts = []
        for fan_in, fan_out in self._shapes:
            bound = self._bound or 1.0 / math.sqrt(fan_in)
            parts.append(torch.rand(members, (fan_in + 1) * fan_out, generator=random).mul_(2.0).sub_(1.0).mul_(bound))
        return torch.cat(parts, dim=1)

    def apply(self, parameters: Tensor, inputs: Tensor) -> Tensor:
        """Inputs [K, N, in] -> outputs [K, N, out]."""
        start, last = 0, len(self._shapes) - 1
        for layer, (fan_in, fan_out) in enumerate(self._shapes):
            middle, end = start + fan_in * fan_out, start + (fan_in + 1) * fan_out
            weight = parameters[:, start:middle].view(-1, fan_in, fan_out)
            bias = parameters[:, middle:end].unsqueeze(1)
            inputs = torch.baddbmm(bias, inputs, weight)
            inputs = inputs if layer == last else torch.relu(inputs)
            start = end
        return inputs


class Body:
    """One way to compute value, potential and information from inputs [K, N, I]."""

    count: int

    def initial(self, members: int, random: torch.Generator) -> Tensor:
        """Draw the parameters [K, count]."""
        raise NotImplementedError

    def output(self, parameters: Tensor, inputs: Tensor, random: torch.Generator | None) -> Output:
        """The output, each [K, N]; ``random`` draws the bottleneck's noise, None takes its mean."""
        raise NotImplementedError


class Perceptron(Body):
    """value = MLP(s, a, s')."""

    def __init__(self, input_size: int, hidden_sizes: Sequence[int]) -> None:
        self._layers = Layers((input_size, *hidden_sizes, 1))
        self.count = self._layers.count

    def initial(self, members: int, random: torch.Generator) -> Tensor:
        """Draw the parameters [K, count]."""
        return self._layers.initial(members, random)

    def output(self, parameters: Tensor, inputs: Tensor, random: torch.Generator | None) -> Output:
        """The output, each [K, N]; nothing is random."""
        zero = inputs.new_zeros(())
        return Output(self._layers.apply(parameters, inputs).squeeze(-1), zero, zero)


class Bottleneck(Body):
    """value = w z + b with z ~ N(mean(x), std(x)^2), x = (s, a, s'); scoring takes z = mean(x).

    Source: Peng et al. (2018), section 4; sizes and initial values from the authors' code for VAIRL.
    """

    def __init__(self, input_size: int, hidden_sizes: Sequence[int], bottleneck_size: int) -> None:
        self._encoder = Layers((input_size, *hidden_sizes))
        self._head = Layers((hidden_sizes[-1], 2 * bottleneck_size), bound=HEAD_BOUND)
        self._last = Layers((bottleneck_size, 1))
        self._split = [self._encoder.count, self._head.count, self._last.count]
        self.count = sum(self._split)

    def initial(self, members: int, random: torch.Generator) -> Tensor:
        """Draw the parameters [K, count]."""
        return torch.cat([part.initial(members, random) for part in (self._encoder, self._head, self._last)], dim=1)

    def output(self, parameters: Tensor, inputs: Tensor, random: torch.Generator | None) -> Output:
        """The output, each [K, N]."""
        encoder, head, last = parameters.split(self._split, dim=1)
        hidden = torch.relu(self._encoder.apply(encoder, inputs))
        mean, log_std = self._head.apply(head, hidden).chunk(2, dim=-1)
        z = mean
        if random is not None:
            z = mean + log_std.exp() * torch.randn(mean.shape, generator=random, device=mean.device)
        value = self._last.apply(last, z).squeeze(-1)
        return Output(value, inputs.new_zeros(()), bottleneck_information(mean, log_std))


class Shaped(Body):
    """A body with a learned potential h beside it; the learned reward leaves h out (Fu et al., 2018, equation 4).

    The discriminator sees f(s, a, s') + gamma h(s') - h(s).
    """

    def __init__(self, inner: Body, state_size: int, hidden_sizes: Sequence[int], discount: float) -> None:
        self._inner, self._state_size, self._discount = inner, state_size, discount
        self._potential = Layers((state_size, *hidden_sizes, 1))
        self._split = [inner.count, self._potential.count]
        self.count = sum(self._split)

    def initial(self, members: int, random: torch.Generator) -> Tensor:
        """Draw the parameters [K, count]."""
        return torch.cat([self._inner.initial(members, random), self._potential.initial(members, random)], dim=1)

    def output(self, parameters: Tensor, inputs: Tensor, random: torch.Generator | None) -> Output:
        """The output, each [K, N]."""
        inner, potential = parameters.split(self._split, dim=1)
        before = self._potential.apply(potential, inputs[..., : self._state_size]).squeeze(-1)
        after = self._potential.apply(potential, inputs[..., -self._state_size :]).squeeze(-1)
        return self._inner.output(inner, inputs, random)._replace(potential=self._discount * after - before)


def network_inputs(transitions: Transitions) -> Tensor:
    """x = (s, a, s') [..., 82] for Meta-World."""
    return torch.cat((transitions.observation, transitions.action, transitions.next_observation), dim=-1)


class RewardNetwork:
    """K learned rewards f = output_scale x value with the parameters [K, P]."""

    def __init__(
        self,
        architecture: Mapping[str, Any],
        members: int = 1,
        random: torch.Generator | None = None,
        device: torch.device | str = "cpu",
    ) -> None:
        """``architecture`` is what ``architecture`` below holds; ``random``, on the CPU, draws the initial parameters.

        Raises:
            UserError: the architecture lacks a key or names an unknown kind.
        """
        self.architecture = dict(architecture)
        self.members = members
        self._body = _body(self.architecture)
        self.output_scale = float(architecture["output_scale"])
        random = random or torch.Generator().manual_seed(0)
        self.parameters = self._body.initial(members, random).to(device).requires_grad_()

    def output(self, inputs: Tensor, random: torch.Generator | None = None) -> Output:
        """Inputs [..., I] -> value, potential and information [...]; with K > 1 the inputs lead with K."""
        shape = inputs.shape[:-1]
        if self.members > 1 and (not shape or shape[0] != self.members):
            raise ValueError(f"{self.members} rewards need inputs that lead with {self.members}, got {tuple(shape)}")
        flat = inputs.reshape(self.members, -1, inputs.shape[-1])
        output = self._body.output(self.parameters, flat, random)
        return Output(*(part if part.dim() == 0 else part.reshape(shape) for part in output))

    def shaped(self, output: Output) -> Tensor:
        """What the discriminator's logit takes: f + gamma h(s') - h(s) [...]."""
        return self.output_scale * output.value + output.potential

    def __call__(self, transitions: Transitions) -> Tensor:
        """The learned reward f(s, a, s') [...]: no gradient, no noise, no potential."""
        with torch.no_grad():
            return self.output_scale * self.output(network_inputs(transitions)).value

    def to(self, device: torch.device | str) -> "RewardNetwork":
        """A copy on another device."""
        return self.from_parameters(self.architecture, self.parameters.detach().to(device))

    def member(self, index: int) -> "RewardNetwork":
        """A copy of one of the K rewards as a network of its own."""
        return self.from_parameters(self.architecture, self.parameters[index : index + 1])

    @classmethod
    def from_parameters(cls, architecture: Mapping[str, Any], parameters: Tensor) -> "RewardNetwork":
        """Networks from parameters [K, P], copied on their device; ValueError if their number does not fit."""
        network = cls(architecture, members=parameters.shape[0], device=parameters.device)
        if network.parameters.shape != parameters.shape:
            raise ValueError(f"expected {network.parameters.shape[1]} parameters, got {parameters.shape[1]}")
        with torch.no_grad():
            network.parameters.copy_(parameters)
        return network


def _body(architecture: Mapping[str, Any]) -> Body:
    try:
        state, action = architecture["observation_size"], architecture["action_size"]
        hidden = architecture["hidden_sizes"]
        if architecture["kind"] == "perceptron":
            body: Body = Perceptron(2 * state + action, hidden)
        elif architecture["kind"] == "bottleneck":
            body = Bottleneck(2 * state + action, hidden, architecture["bottleneck_size"])
        else:
            raise UserError(f"reward network: unknown kind {architecture['kind']!r}; known: perceptron, bottleneck")
        if architecture["shaping"]:
            body = Shaped(body, state, hidden, architecture["discount"])
        return body
    except KeyError as error:
        raise UserError(f"reward network: its description lacks {error}; make the reward again") from error
