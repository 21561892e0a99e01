"""Soft actor-critic for several agents at once, as one tensor program.

The algorithm and its order of operations are those of stable-baselines3 2.9 (temperature, critics, actor, target
critics); a test holds the parameters of both against each other. Every tensor starts with the agent dimension A.
No transition is terminal: Meta-World's episodes end by the time limit alone.

Source: Haarnoja et al., Soft Actor-Critic Algorithms and Applications, arXiv:1812.05905.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
import torch
from torch import Tensor

from mtcsirl.agents.gaussian import (
    SquashedSample,
    squashed_log_prob,
    squashed_sample,
    squashed_sample_gradient,
)
from mtcsirl.agents.graph import CudaGraph
from mtcsirl.agents.networks import NetworkStack, Workspace
from mtcsirl.agents.optimiser import FlatAdam
from mtcsirl.episodes.policy import Policy

if TYPE_CHECKING:
    from mtcsirl.settings import SacSettings

_SUMMED = ("actor_loss", "critic_loss", "temperature", "entropy")


class FusedSac:
    """A SAC agents with their own parameters, stepped together.

    The twin critics of all agents are one stack of 2A networks: critic c of agent a is network c A + a.
    Initial weights of agent a depend on seeds[a] alone; the noise of all agents comes from one generator.
    """

    def __init__(
        self,
        agents: int,
        settings: SacSettings,
        *,
        seeds: Sequence[int],
        observation_size: int = 39,
        action_size: int = 4,
        device: str | torch.device | None = None,
        dtype: torch.dtype = torch.float32,
    ) -> None:
        """Make `agents` learners; `device` defaults to the setting, `dtype` float64 is for tests."""
        if len(seeds) != agents:
            raise ValueError(f"{agents} agents need as many seeds, not {len(seeds)}")
        self.agents, self.settings, self.action_size = agents, settings, action_size
        self.device = torch.device(settings.device if device is None else device)
        self._like: dict[str, Any] = {"device": self.device, "dtype": dtype}
        self._log_std_bounds = (settings.min_log_std, settings.max_log_std)
        automatic_entropy = settings.target_entropy == "automatic"
        self._target_entropy = float(-action_size if automatic_entropy else settings.target_entropy)

        actor_sizes = (observation_size, *settings.hidden_sizes, 2 * action_size)
        critic_sizes = (observation_size + action_size, *settings.hidden_sizes, 1)
        self.actor = NetworkStack(agents, actor_sizes, **self._like)
        self.critics = NetworkStack(2 * agents, critic_sizes, **self._like)
        self.target_critics = NetworkStack(2 * agents, critic_sizes, **self._like)
        for agent, seed in enumerate(seeds):
            generator = torch.Generator().manual_seed(seed)
            self.actor.initialise(agent, generator)
            self.critics.initialise(agent, generator)
            self.critics.initialise(agents + agent, generator)
        self.target_critics.parameters.copy_(self.critics.parameters)

        fixed = settings.temperature != "automatic"
        initial = float(settings.temperature) if fixed else settings.initial_temperature
        self.log_temperature = torch.full((agents,), initial, **self._like).log_()
        self._log_temperature_gradient = torch.zeros_like(self.log_temperature)
        self._optimisers = {
            "actor": FlatAdam(self.actor.parameters, self.actor.gradient, settings.policy_learning_rate),
            "critics": FlatAdam(self.critics.parameters, self.critics.gradient, settings.critic_learning_rate),
        }
        if not fixed:
            self._optimisers["temperature"] = FlatAdam(
                self.log_temperature, self._log_temperature_gradient, settings.temperature_learning_rate
            )

        self.updates = 0
        self._metric_sums = torch.zeros(len(_SUMMED), agents, **self._like)
        self._metric_updates = 0
        noise_seed = int(np.random.SeedSequence(list(seeds)).generate_state(1, np.uint64)[0] >> 1)
        self._generator = torch.Generator(self.device).manual_seed(noise_seed)
        self._programs: dict[int, Callable[..., None]] = {}
        self._workspaces: dict[tuple[str, int], Workspace] = {}

    # --- acting -----------------------------------------------------------------------------------------------

    @torch.no_grad()
    def act(self, observation: Tensor, deterministic: bool = False) -> Tensor:
        """Actions [A, 4] in (-1, 1) for observations [A, 39]: a sample of each policy, or its mode."""
        head = self.actor.forward(observation.unsqueeze(1), self._workspace("act", 1)).squeeze(1)
        mean, log_std = head.chunk(2, dim=-1)
        if deterministic:
            return torch.tanh(mean)
        noise = torch.randn(mean.shape, generator=self._generator, **self._like)
        return log_std.clamp(*self._log_std_bounds).exp_().mul_(noise).add_(mean).tanh_()

    @torch.no_grad()
    def log_prob(self, observation: Tensor, action: Tensor) -> Tensor:
        """log pi(a|s) [A, B] of given actions [A, B, 4], clipped to +-(1 - 1e-3), in observations [A, B, 39]."""
        head = self.actor.forward(observation, self._workspace("act", observation.shape[1]))
        return squashed_log_prob(head, action, *self._log_std_bounds)

    def policy(self, agent: int) -> Policy:
        """A frozen copy of one agent's actor."""
        weights = tuple(weight[agent].cpu().numpy().astype(np.float32) for weight in self.actor.weights)
        biases = tuple(bias[agent, 0].cpu().numpy().astype(np.float32) for bias in self.actor.biases)
        return Policy(weights, biases, *self._log_std_bounds)

    # --- learning ---------------------------------------------------------------------------------------------

    @torch.no_grad()
    def update(
        self,
        observation: Tensor,
        action: Tensor,
        reward: Tensor,
        next_observation: Tensor,
        noise: Tensor | None = None,
    ) -> None:
        """One gradient step of every agent on its own minibatch.

        observation, next_observation [A, B, 39]; action [A, B, 4]; reward [A, B], already scaled;
        noise [A, 2, B, 4] standard normal, of the actions in s and in s'; drawn here if not given.
        """
        minibatch = observation.shape[1]
        if noise is None:
            shape = (self.agents, 2, minibatch, self.action_size)
            noise = torch.randn(shape, generator=self._generator, **self._like)
        if minibatch not in self._programs:
            on_cuda = self.device.type == "cuda"
            self._programs[minibatch] = CudaGraph(self._gradient_step) if on_cuda else self._gradient_step
        self._programs[minibatch](observation, action, reward, next_observation, noise)
        self.updates += 1
        self._metric_updates += 1

    def _gradient_step(
        self, observation: Tensor, action: Tensor, reward: Tensor, next_observation: Tensor, noise: Tensor
    ) -> None:
        sample, next_sample = self._sample_actions(observation, next_observation, noise)
        temperature = self.log_temperature.exp()
        entropy = -sample.log_prob.mean(1)
        self._step_temperature(entropy)
        next_q = self._q_values(self.target_critics, next_observation, next_sample.action).amin(0)
        soft_value = next_q.sub_(temperature[:, None] * next_sample.log_prob)
        target = torch.add(reward, soft_value, alpha=self.settings.discount)
        critic_loss = self._step_critics(observation, action, target)
        actor_loss = self._step_actor(observation, sample, temperature)
        self.target_critics.parameters.lerp_(self.critics.parameters, self.settings.polyak)
        self._metric_sums.add_(torch.stack((actor_loss, critic_loss, temperature, entropy)))

    def _step_temperature(self, entropy: Tensor) -> None:
        """Loss -log(alpha) x mean(log pi + target entropy), whose gradient in log(alpha) is the entropy gap."""
        if "temperature" in self._optimisers:
            torch.sub(entropy, self._target_entropy, out=self._log_temperature_gradient)
            self._optimisers["temperature"].step()

    def _step_critics(self, observation: Tensor, action: Tensor, target: Tensor) -> Tensor:
        """Loss 1/2 sum_i mean (Q_i(s, a) - y)^2 with y = r + gamma (min_i Q'_i(s', a') - alpha log pi(a'|s'))."""
        error = self._q_values(self.critics, observation, action) - target
        minibatch = error.shape[-1]
        self.critics.backward((error / minibatch).view(-1, minibatch, 1), self._workspace("critics", minibatch))
        self._optimisers["critics"].step()
        return error.square().mean(-1).sum(0).mul_(0.5)

    def _step_actor(self, observation: Tensor, sample: SquashedSample, temperature: Tensor) -> Tensor:
        """Loss mean(alpha log pi(a|s) - min_i Q_i(s, a)) with a drawn from the policy."""
        q_values = self._q_values(self.critics, observation, sample.action)
        minibatch = q_values.shape[-1]
        first_is_less = q_values[0] <= q_values[1]
        q_gradient = torch.stack((first_is_less, ~first_is_less)).to(q_values.dtype).mul_(-1.0 / minibatch)
        action_gradient = self.critics.input_gradient(
            q_gradient.view(-1, minibatch, 1),
            self._workspace("critics", minibatch),
            columns=slice(observation.shape[-1], None),
        )
        head_gradient = squashed_sample_gradient(
            sample,
            action_gradient.view(2, self.agents, minibatch, -1).sum(0),
            (temperature / minibatch)[:, None, None],
        )
        self.actor.backward(head_gradient, self._workspace("actor in s", minibatch))
        self._optimisers["actor"].step()
        return (temperature[:, None] * sample.log_prob).sub_(q_values.amin(0)).mean(1)

    def _sample_actions(
        self, observation: Tensor, next_observation: Tensor, noise: Tensor
    ) -> tuple[SquashedSample, SquashedSample]:
        """Actions in s and in s', by one pass through the actor."""
        both = torch.cat((observation, next_observation), dim=1)
        head = self.actor.forward(both, self._workspace("actor", both.shape[1]))
        sample = squashed_sample(head, noise.flatten(1, 2), *self._log_std_bounds)
        now, following = zip(*(tensor.chunk(2, dim=1) for tensor in sample), strict=True)
        return SquashedSample(*now), SquashedSample(*following)

    def _q_values(self, critics: NetworkStack, observation: Tensor, action: Tensor) -> Tensor:
        """Q values [2, A, B] of both critics of every agent."""
        workspace = self._workspace("critics", observation.shape[1])
        inputs = workspace.activations[0].view(2, *observation.shape[:2], -1)
        inputs[0] = torch.cat((observation, action), dim=-1)
        inputs[1] = inputs[0]
        return critics.forward(workspace.activations[0], workspace).view(2, self.agents, -1)

    def _workspace(self, role: str, minibatch: int) -> Workspace:
        """The memory of a pass of so many rows: of the critics, of the actor learning, its first half, or acting."""
        if (role, minibatch) not in self._workspaces:
            if role == "actor in s":
                made = self._workspace("actor", 2 * minibatch).first_rows(minibatch)
            else:
                made = (self.critics if role == "critics" else self.actor).workspace(minibatch)
            self._workspaces[role, minibatch] = made
        return self._workspaces[role, minibatch]

    def fix_temperature(self, value: float) -> None:
        """Hold every agent's temperature at `value` from now on, automatic or not until here."""
        self._optimisers.pop("temperature", None)
        self.log_temperature.fill_(math.log(value))
        self._programs.clear()

    # --- reading and restoring --------------------------------------------------------------------------------

    @property
    def temperature(self) -> Tensor:
        """The entropy temperature alpha of each agent, [A]."""
        return self.log_temperature.exp()

    def metrics(self) -> dict[str, Tensor]:
        """Means [A] over the updates since the last call and the norms of the last gradient; empty without updates."""
        if self._metric_updates == 0:
            return {}
        means = self._metric_sums / self._metric_updates
        self._metric_sums.zero_()
        self._metric_updates = 0
        return dict(zip(_SUMMED, means, strict=True)) | {
            "actor_gradient_norm": self.actor.gradient.norm(dim=1),
            "critic_gradient_norm": self.critics.gradient.view(2, self.agents, -1).norm(dim=(0, 2)),
        }

    def state_dict(self) -> dict[str, Tensor]:
        """Everything that an exact resume needs, as named tensors (not copies)."""
        state = {
            "actor": self.actor.parameters,
            "critics": self.critics.parameters,
            "target_critics": self.target_critics.parameters,
            "log_temperature": self.log_temperature,
            "metric_sums": self._metric_sums,
            "counts": torch.tensor([self.updates, self._metric_updates]),
            "generator": self._generator.get_state(),
        }
        for name, optimiser in self._optimisers.items():
            state.update({f"{name}_adam_{key}": tensor for key, tensor in optimiser.state().items()})
        return state

    def load_state_dict(self, state: dict[str, Tensor]) -> None:
        """Restore what `state_dict` gave, in place."""
        self._generator.set_state(state["generator"].cpu())
        self.updates, self._metric_updates = (int(count) for count in state["counts"])
        for name, tensor in self.state_dict().items():
            if name not in ("generator", "counts"):
                tensor.copy_(state[name])
