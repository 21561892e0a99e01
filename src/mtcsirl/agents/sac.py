"""Soft actor-critic for several agents at once, as one tensor program.

The algorithm and its order of operations are those of stable-baselines3 2.9 (temperature, critics, actor, target
critics); a test holds the parameters of both against each other. Every tensor starts with the agent dimension A.
No transition is terminal: Meta-World's episodes end by the time limit alone. An agent has the same bits alone and among
others: its noise comes from streams of its own and no sum runs over agents.

Source: Haarnoja et al., Soft Actor-Critic Algorithms and Applications, arXiv:1812.05905.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from functools import reduce
from typing import TYPE_CHECKING, Any

import numpy as np
import torch
from torch import Tensor

from mtcsirl.agents.finite import broken_agents
from mtcsirl.agents.gaussian import SquashedSample, squashed_log_prob, squashed_sample, squashed_sample_gradient
from mtcsirl.agents.graph import CudaGraph
from mtcsirl.agents.networks import NetworkStack, Workspace
from mtcsirl.agents.optimiser import FlatAdam
from mtcsirl.agents.products import ALIGNED
from mtcsirl.agents.streams import Purpose, Streams
from mtcsirl.episodes.policy import Policy

if TYPE_CHECKING:
    from mtcsirl.settings import SacSettings

_SUMMED = ("actor_loss", "critic_loss", "temperature", "entropy")


class FusedSac:
    """A SAC agents with their own parameters, stepped together.

    The C critics of all agents are one stack of C A networks: critic c of agent a is network c A + a.
    Initial weights and noise of agent a depend on seeds[a] alone.
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
        self.critics = NetworkStack(settings.critics * agents, critic_sizes, **self._like)
        self.target_critics = NetworkStack(settings.critics * agents, critic_sizes, **self._like)
        for agent, seed in enumerate(seeds):
            generator = torch.Generator().manual_seed(seed)
            self.actor.initialise(agent, generator)
            for critic in range(settings.critics):
                self.critics.initialise(critic * agents + agent, generator)
        self.target_critics.parameters.copy_(self.critics.parameters)

        fixed = settings.temperature != "automatic"
        initial = float(settings.temperature) if fixed else settings.initial_temperature
        # One number of each row is used: all of it is aligned as networks are (agents/products.py).
        self._log_temperatures = torch.full((agents, ALIGNED), initial, **self._like).log_()
        self._log_temperature_gradients = torch.zeros_like(self._log_temperatures)
        self.log_temperature = self._log_temperatures[:, 0]
        self._optimisers = {
            "actor": FlatAdam(self.actor.parameters, self.actor.gradient, settings.policy_learning_rate),
            "critics": FlatAdam(self.critics.parameters, self.critics.gradient, settings.critic_learning_rate),
        }
        if not fixed:
            self._optimisers["temperature"] = FlatAdam(
                self._log_temperatures, self._log_temperature_gradients, settings.temperature_learning_rate
            )

        self.updates = 0
        self._metric_sums = torch.zeros(len(_SUMMED), agents, **self._like)
        self._metric_updates = 0
        self._seeds, self._acted = tuple(seeds), 0
        self._action_noise = Streams(seeds, Purpose.ACTIONS, (action_size,), **self._like)
        self._update_noise: dict[int, Streams] = {}
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
        noise = self._action_noise.draw(self._acted)
        self._acted += 1
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
        if minibatch not in self._programs:
            on_cuda = self.device.type == "cuda"
            self._programs[minibatch] = CudaGraph(self._gradient_step) if on_cuda else self._gradient_step
            shape = (2, minibatch, self.action_size)
            self._update_noise[minibatch] = Streams(self._seeds, Purpose.UPDATES, shape, **self._like)
        if noise is None:
            noise = self._update_noise[minibatch].draw(self.updates)
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
            torch.sub(entropy, self._target_entropy, out=self._log_temperature_gradients[:, 0])
            self._optimisers["temperature"].step()

    def _step_critics(self, observation: Tensor, action: Tensor, target: Tensor) -> Tensor:
        """Loss 1/2 sum_i mean (Q_i(s, a) - y)^2 with y = r + gamma (min_i Q'_i(s', a') - alpha log pi(a'|s'))."""
        error = self._q_values(self.critics, observation, action) - target
        minibatch = error.shape[-1]
        self.critics.backward((error / minibatch).view(-1, minibatch, 1), self._workspace("critics", minibatch))
        self._optimisers["critics"].step()
        return _added(error.square().mean(-1)).mul_(0.5)

    def _step_actor(self, observation: Tensor, sample: SquashedSample, temperature: Tensor) -> Tensor:
        """Loss mean(alpha log pi(a|s) - min_i Q_i(s, a)) with a drawn from the policy."""
        q_values = self._q_values(self.critics, observation, sample.action)
        minibatch = q_values.shape[-1]
        least = q_values.argmin(0, keepdim=True)
        q_gradient = torch.zeros_like(q_values).scatter_(0, least, -1.0 / minibatch)
        action_gradient = self.critics.input_gradient(
            q_gradient.view(-1, minibatch, 1),
            self._workspace("critics", minibatch),
            columns=slice(observation.shape[-1], None),
        )
        head_gradient = squashed_sample_gradient(
            sample,
            _added(action_gradient.unflatten(0, (-1, self.agents))),
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
        """Q values [C, A, B] of the critics of every agent."""
        workspace = self._workspace("critics", observation.shape[1])
        inputs = workspace.activations[0].view(-1, *observation.shape[:2], workspace.activations[0].shape[-1])
        inputs.copy_(torch.cat((observation, action), dim=-1))
        return critics.forward(workspace.activations[0], workspace).view(-1, *observation.shape[:2])

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
            "critic_gradient_norm": _added(self._own(self.critics.gradient).norm(dim=-1).square()).sqrt(),
        }

    def broken_agents(self) -> dict[int, str]:
        """The agents of which a number is not finite, and what it is: looks at all parameters and all losses since the
        last `metrics`, so nothing that was ever not finite escapes it."""
        stacks = {"critics": self.critics, "actor": self.actor}
        parts = {f"the {name}' parameters": self._own(stack.parameters) for name, stack in stacks.items()}
        by_agent = {name: tensor.transpose(0, 1).flatten(1) for name, tensor in parts.items()}
        losses = dict(zip(_SUMMED, self._metric_sums.unsqueeze(-1), strict=True))
        return broken_agents({name.replace("_", " "): values for name, values in losses.items()} | by_agent)

    def _own(self, rows: Tensor) -> Tensor:
        """Rows [n A, P] of networks by network and agent [n, A, P]."""
        return rows.view(-1, self.agents, rows.shape[-1])

    def _tensors(self) -> dict[str, Tensor]:
        """What learning changes, each [n, A, ...] (views)."""
        tensors = {
            "actor": self.actor.parameters,
            "critics": self.critics.parameters,
            "target_critics": self.target_critics.parameters,
            "log_temperature": self._log_temperatures,
        }
        for name, optimiser in self._optimisers.items():
            tensors |= {f"{name}_adam_mean": optimiser.mean, f"{name}_adam_square": optimiser.square}
        return {name: self._own(rows) for name, rows in tensors.items()} | {"metric_sums": self._metric_sums}

    def state_dict(self, agent: int) -> dict[str, Tensor]:
        """Everything that an exact resume of one agent needs, alone or among others, as named tensors (not copies)."""
        state = {name: rows[:, agent] for name, rows in self._tensors().items()}
        state["counts"] = torch.tensor([self.updates, self._metric_updates, self._acted])
        steps = {f"{name}_adam_steps": optimiser.steps for name, optimiser in self._optimisers.items()}
        return state | steps

    def load_state_dict(self, agent: int, state: dict[str, Tensor]) -> None:
        """Restore what `state_dict` gave, in place; all agents have to come from the same step."""
        self.updates, self._metric_updates, self._acted = (int(count) for count in state["counts"])
        for name, tensor in self.state_dict(agent).items():
            if name != "counts":
                tensor.copy_(state[name])


def _added(parts: Tensor) -> Tensor:
    """The sum over the first dimension, term by term: a reduction may add in an order that depends on the shape."""
    return reduce(torch.add, parts.unbind(0))
