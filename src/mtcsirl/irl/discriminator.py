"""A discriminator: a learned reward, its loss and its optimiser; and a method: what the generators get from it."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import NamedTuple

import torch
from torch import Tensor

from mtcsirl.agents.optimiser import FlatAdam
from mtcsirl.irl.losses import Adversarial, Pass, Points
from mtcsirl.rewards.networks import RewardNetwork, network_inputs
from mtcsirl.transitions import Transitions


class Batch(NamedTuple):
    """A minibatch of T tasks: transitions [T, B], log pi [T, B] already clamped, temperature [T, 1]."""

    expert: Transitions
    generator: Transitions
    expert_log_pi: Tensor
    generator_log_pi: Tensor
    temperature: Tensor

    def only(self, task: int) -> "Batch":
        """The part of one task, T = 1."""
        pick = slice(task, task + 1)
        return Batch(
            Transitions(*(part[pick] for part in self.expert)),
            Transitions(*(part[pick] for part in self.generator)),
            self.expert_log_pi[pick],
            self.generator_log_pi[pick],
            self.temperature[pick],
        )


class Discriminator:
    """A learned reward f with its loss and Adam."""

    def __init__(
        self, network: RewardNetwork, loss: Adversarial, learning_rate: float, random: torch.Generator
    ) -> None:
        """``random`` draws the noise of the loss: interpolation and bottleneck."""
        self.network, self.loss, self._random = network, loss, random
        self._gradient = torch.zeros_like(network.parameters, requires_grad=False)
        self._adam = FlatAdam(network.parameters.detach(), self._gradient, learning_rate)

    def forward(self, batch: Batch, *, noise: bool = True) -> Pass:
        """Run the network over both sides of a minibatch; ``noise``: sample a bottleneck's z or take its mean."""
        random = self._random if noise else None
        expert = Points(network_inputs(batch.expert), batch.expert.task_reward, batch.expert_log_pi)
        generator = Points(network_inputs(batch.generator), batch.generator.task_reward, batch.generator_log_pi)
        return Pass(
            self.network,
            expert,
            generator,
            batch.temperature,
            self.network.output(expert.inputs, random),
            self.network.output(generator.inputs, random),
            self._random,
        )

    def update(self, batch: Batch) -> tuple[Tensor, Tensor]:
        """One Adam step on the sum of the tasks' losses; returns the loss [T] and the gradient's norm (scalar).

        With one network per task the sum separates: each network takes the step it would take alone.
        """
        forward = self.forward(batch)
        loss = self.loss(forward)
        (gradient,) = torch.autograd.grad(loss.sum(), self.network.parameters)
        self._gradient.copy_(gradient)
        self._adam.step()
        self.loss.after_update(forward)
        return loss.detach(), gradient.norm()

    def logits(self, batch: Batch) -> tuple[Tensor, Tensor]:
        """Logits of expert and generator [T, B], without gradient and without noise."""
        with torch.no_grad():
            return self.loss.logits(self.forward(batch, noise=False))

    def state(self) -> dict[str, Tensor]:
        """The tensors that a checkpoint needs (not copies, but for the random state)."""
        state = {"parameters": self.network.parameters.detach(), "random": self._random.get_state()}
        state.update({f"adam_{name}": tensor for name, tensor in self._adam.state().items()})
        state.update({f"loss_{name}": tensor for name, tensor in self.loss.state().items()})
        return state

    def load_state(self, state: Mapping[str, Tensor]) -> None:
        """Restore what ``state`` gave, in place."""
        self._random.set_state(state["random"])
        for name, tensor in self.state().items():
            if name != "random":
                tensor.copy_(state[name])


GeneratorReward = Callable[[Tensor, Mapping[str, Tensor], Tensor], Tensor]
"""(r_task [T, B], learned rewards by name [T, B], alpha [T, 1]) -> the generators' reward [T, B]."""


@dataclass(frozen=True)
class Method:
    """One IRL method: its discriminators and the reward of its generators.

    The discriminator ``f`` holds the reward that is kept, shared by all tasks; MT-CSIRL+LT has ``task`` beside it, one
    per task.
    """

    discriminators: Mapping[str, Discriminator]
    policy_reward: GeneratorReward
    knows_task_reward: bool
    """Whether generators may train on the task reward: then they may be warmed up on it."""
    uses_curriculum: bool
    """Whether alpha = r_ave / R_MAX enters the policy reward; else alpha is 1."""
    name: str = ""
    """The one under which it is registered; ``make_method`` fills it in."""
