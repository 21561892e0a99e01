"""stable-baselines3's SAC behind the interface of the fused learner: the reference in tests and benchmarks.

Chosen by `sac.learner: stable_baselines3`. Rewards are relabelled on sampling here too: every update hands the
relabelled minibatch to the model's replay buffer. The library draws from torch's global random numbers, so each model
has a state of them of its own, which is put in place while it acts or learns.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any, cast

import gymnasium
import numpy as np
import torch
from stable_baselines3 import SAC
from stable_baselines3.common.buffers import ReplayBuffer
from stable_baselines3.common.logger import Logger
from stable_baselines3.common.type_aliases import ReplayBufferSamples
from torch import Tensor

from mtcsirl.agents.finite import broken_agents
from mtcsirl.agents.networks import NetworkStack
from mtcsirl.agents.sac import FusedSac
from mtcsirl.episodes.policy import Policy
from mtcsirl.errors import UserError

if TYPE_CHECKING:
    from mtcsirl.settings import SacSettings


class Spaces(gymnasium.Env):
    """An environment that only says what it would look like."""

    def __init__(self, observation_size: int, action_size: int) -> None:
        self.observation_space = gymnasium.spaces.Box(-np.inf, np.inf, (observation_size,), np.float32)
        self.action_space = gymnasium.spaces.Box(-1.0, 1.0, (action_size,), np.float32)


class RelabelledBuffer(ReplayBuffer):
    """A replay buffer whose next sample is a minibatch that was drawn and relabelled elsewhere."""

    def hand_over(self, observation: Tensor, action: Tensor, reward: Tensor, next_observation: Tensor) -> None:
        """Set the minibatch [B, ...] that the next `sample` returns."""
        reward = reward[:, None]
        self._given = ReplayBufferSamples(observation, action, next_observation, torch.zeros_like(reward), reward)

    def sample(self, batch_size: int, env: Any = None) -> ReplayBufferSamples:
        """The minibatch that was handed over."""
        return self._given


class ReferenceSac:
    """A list of stable-baselines3 SAC models with `FusedSac`'s methods; see there for the shapes."""

    def __init__(
        self,
        agents: int,
        settings: SacSettings,
        *,
        seeds: Sequence[int],
        observation_size: int = 39,
        action_size: int = 4,
        device: str | torch.device | None = None,
    ) -> None:
        self.agents, self.settings, self.updates = agents, settings, 0
        self.device = torch.device(settings.device if device is None else device)
        spaces = Spaces(observation_size, action_size)
        self.models, self._random = [], []
        for seed in seeds:
            self.models.append(make_sb3(settings, spaces, seed, self.device))
            self._random.append(torch.get_rng_state())
        self._view = FusedSac(
            1, settings, seeds=[0], observation_size=observation_size, action_size=action_size, device=self.device
        )

    @torch.no_grad()
    def act(self, observation: Tensor, deterministic: bool = False) -> Tensor:
        """Actions [A, 4] for observations [A, 39]."""
        actions = torch.full((self.agents, self._view.action_size), torch.nan, device=self.device)
        for agent, row in enumerate(observation):
            with self._as(agent) as model:
                actions[agent] = model.actor(row[None], deterministic=deterministic)
        return actions

    def update(self, observation: Tensor, action: Tensor, reward: Tensor, next_observation: Tensor) -> None:
        """One gradient step of every model on its own minibatch [A, B, ...]."""
        for agent in range(self.agents):
            with self._as(agent) as model:
                buffer = cast(RelabelledBuffer, model.replay_buffer)
                buffer.hand_over(observation[agent], action[agent], reward[agent], next_observation[agent])
                model.train(1, observation.shape[1])
        self.updates += 1

    @contextmanager
    def _as(self, agent: int) -> Iterator[SAC]:
        """A model with torch's random numbers where it left them.

        The library refuses a policy that is not finite with an error of its own; ours is for who asks `broken_agents`.
        """
        torch.set_rng_state(self._random[agent])
        try:
            yield self.models[agent]
        except ValueError:
            if agent not in self.broken_agents():
                raise
        self._random[agent] = torch.get_rng_state()

    def fix_temperature(self, value: float) -> None:
        """Hold every model's temperature at `value` from now on."""
        for model in self.models:
            model.log_ent_coef = model.ent_coef_optimizer = None
            model.ent_coef_tensor = torch.tensor(value, device=self.device)

    @torch.no_grad()
    def log_prob(self, observation: Tensor, action: Tensor) -> Tensor:
        """log pi(a|s) [A, B], computed as the fused learner does."""
        rows = []
        for agent in range(self.agents):
            self._show(agent)
            rows.append(self._view.log_prob(observation[agent : agent + 1], action[agent : agent + 1]))
        return torch.cat(rows)

    def policy(self, agent: int) -> Policy:
        """A frozen copy of one model's actor."""
        self._show(agent)
        return self._view.policy(0)

    @property
    def temperature(self) -> Tensor:
        """The entropy temperature of each model, [A]."""
        return torch.cat([_log_temperature(model).detach().reshape(1) for model in self.models]).exp()

    def metrics(self) -> dict[str, Tensor]:
        """Only the temperature; the models' own logger is silent."""
        return {"temperature": self.temperature} if self.updates else {}

    def broken_agents(self) -> dict[int, str]:
        """The agents of which a parameter is not finite, and of what."""
        found: dict[int, str] = {}
        for agent, model in enumerate(self.models):
            parts = {
                f"the parameter {name}": tensor.reshape(1, -1) for name, tensor in model.policy.state_dict().items()
            }
            parts["the temperature"] = _log_temperature(model).detach().reshape(1, 1)
            found.update((agent, name) for name in broken_agents(parts).values())
        return found

    def state_dict(self, agent: int) -> dict[str, Tensor]:
        """Everything that an exact resume of one agent needs."""
        counts = {"updates": torch.tensor(self.updates), "torch_random": self._random[agent]}
        return counts | {name: tensor.detach() for name, tensor in _tensors(self.models[agent]).items()}

    def load_state_dict(self, agent: int, state: dict[str, Tensor]) -> None:
        """Restore what `state_dict` gave, in place."""
        self.updates = int(state["updates"])
        for name, tensor in _tensors(self.models[agent]).items():
            tensor.data.copy_(state[name])
        self._random[agent] = state["torch_random"].cpu().clone()

    def _show(self, agent: int) -> None:
        copy_from_sb3(self.models[agent], self._view)


def make_sb3(settings: SacSettings, spaces: gymnasium.Env, seed: int, device: torch.device | str) -> SAC:
    """A stable-baselines3 SAC with these settings.

    Raises UserError for settings that stable-baselines3 has no switch for.
    """
    if settings.policy_learning_rate != settings.critic_learning_rate or (
        settings.temperature == "automatic" and settings.temperature_learning_rate != settings.critic_learning_rate
    ):
        raise UserError("sac.learner: stable_baselines3 has one learning rate; make all three equal or use fused")
    if (settings.min_log_std, settings.max_log_std) != (-20.0, 2.0):
        raise UserError("sac.learner: stable_baselines3 clamps log_std to [-20, 2]; use fused for other bounds")
    automatic = settings.temperature == "automatic"
    model = SAC(
        "MlpPolicy",
        spaces,
        learning_rate=settings.policy_learning_rate,
        buffer_size=1,
        batch_size=settings.minibatch,
        tau=settings.polyak,
        gamma=settings.discount,
        replay_buffer_class=RelabelledBuffer,
        ent_coef=f"auto_{settings.initial_temperature}" if automatic else float(settings.temperature),
        target_entropy="auto" if settings.target_entropy == "automatic" else settings.target_entropy,
        policy_kwargs={"net_arch": list(settings.hidden_sizes), "n_critics": settings.critics},
        seed=seed,
        device=device,
    )
    model.set_logger(Logger(folder=None, output_formats=[]))
    return model


@torch.no_grad()
def copy_from_sb3(model: SAC, learner: FusedSac) -> None:
    """Copy actor, critics, target critics and temperature of a model into a learner of one agent."""
    actor: Any = model.actor
    layers = [(layer.weight, layer.bias) for layer in _linear(actor.latent_pi)]
    head = torch.cat((actor.mu.weight, actor.log_std.weight)), torch.cat((actor.mu.bias, actor.log_std.bias))
    _fill(learner.actor, 0, [*layers, head])
    for stack, critic in ((learner.critics, model.critic), (learner.target_critics, model.critic_target)):
        for network, q_network in enumerate(critic.q_networks):
            _fill(stack, network, [(layer.weight, layer.bias) for layer in _linear(q_network)])
    learner.log_temperature.copy_(_log_temperature(model).reshape(1))


def _linear(module: Any) -> list[torch.nn.Linear]:
    return [layer for layer in module if isinstance(layer, torch.nn.Linear)]


def _fill(stack: NetworkStack, network: int, layers: list[tuple[Tensor, Tensor]]) -> None:
    for index, (weight, bias) in enumerate(layers):
        stack.weights[index][network].copy_(weight)
        stack.biases[index][network, 0].copy_(bias)


def _log_temperature(model: SAC) -> Tensor:
    return model.ent_coef_tensor.log() if model.log_ent_coef is None else model.log_ent_coef


def _tensors(model: SAC) -> dict[str, Tensor]:
    """The parameters of a model and the state of its optimisers (zeros where Adam has none yet)."""
    tensors = dict(model.policy.state_dict())
    optimisers = {"actor": model.actor.optimizer, "critic": model.critic.optimizer}
    if model.ent_coef_optimizer is not None:
        tensors["log_ent_coef"] = model.log_ent_coef
        optimisers["temperature"] = model.ent_coef_optimizer
    for name, optimiser in optimisers.items():
        for group in optimiser.param_groups:
            for index, parameter in enumerate(group["params"]):
                state = optimiser.state[parameter]
                if not state:
                    state["step"] = torch.tensor(0.0)
                    state["exp_avg"] = torch.zeros_like(parameter)
                    state["exp_avg_sq"] = torch.zeros_like(parameter)
                tensors |= {f"{name}/{index}/{key}": state[key] for key in ("step", "exp_avg", "exp_avg_sq")}
    return tensors
