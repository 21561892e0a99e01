"""Replay memory of several agents that step together; rewards are computed when transitions are sampled."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import torch
from torch import Tensor

from mtcsirl.agents.streams import Purpose, Streams, uniform
from mtcsirl.errors import UserError
from mtcsirl.transitions import Transitions


class Replay:
    """The last `capacity` transitions of A agents, one row [s, a, s', r_task] each, float32.

    It holds the task reward as the environment gave it and never a mixture: whoever samples applies the reward
    function of the moment to the sampled transitions, so a learned reward that has changed since counts at once.
    """

    def __init__(
        self,
        seeds: Sequence[int],
        capacity: int,
        *,
        observation_size: int = 39,
        action_size: int = 4,
        device: str | torch.device = "cpu",
    ) -> None:
        """Allocate [A, capacity, 2 x observation + action + 1]; agent i draws its samples by seeds[i]."""
        self.size = 0
        """Transitions per agent in memory."""
        self._added = 0
        self._split = (observation_size, action_size, observation_size, 1)
        agents = len(seeds)
        self._rows = torch.zeros(agents, capacity, sum(self._split), device=device)
        self._flat_rows = self._rows.view(agents * capacity, -1)
        self._first_rows = torch.arange(0, agents * capacity, capacity, device=device)[:, None]
        self._seeds, self._sampled = tuple(seeds), 0
        self._streams: dict[int, Streams] = {}

    @property
    def capacity(self) -> int:
        """Transitions per agent that fit; older ones are overwritten."""
        return self._rows.shape[1]

    def add(
        self,
        observation: np.ndarray,
        action: np.ndarray,
        next_observation: np.ndarray,
        task_reward: np.ndarray,
        dropped: np.ndarray | None = None,
    ) -> None:
        """Add one transition per agent: [A, 39], [A, 4], [A, 39], [A].

        An agent in `dropped` [A] has none this time; its last one is there once more, so that all remain in step.
        """
        row = np.concatenate((observation, action, next_observation, task_reward[:, None]), axis=1, dtype=np.float32)
        given = torch.from_numpy(row)
        if dropped is not None and dropped.any():
            if self.size == 0:
                raise UserError("the simulation diverged in its first step; nothing can be learned from it")
            given[dropped] = self._rows[dropped, (self._added - 1) % self.capacity].cpu()
        self._rows[:, self._added % self.capacity] = given
        self._added += 1
        self.size = min(self._added, self.capacity)

    def sample(self, minibatch: int, recent: int | None = None) -> Transitions:
        """Uniform transitions [A, minibatch, ...], with replacement, of the last `recent` steps or of all.

        Raises ValueError when nothing was added yet.
        """
        if self.size == 0:
            raise ValueError("nothing to sample: the replay memory is empty")
        if minibatch not in self._streams:
            self._streams[minibatch] = Streams(
                self._seeds, Purpose.MINIBATCHES, (minibatch,), uniform, self._rows.device, torch.float64
            )
        span = self.size if recent is None else min(recent, self.size)
        ages = self._streams[minibatch].draw(self._sampled).mul(span).long().add_(1)
        self._sampled += 1
        indices = (self._added - ages).remainder_(self.capacity).add_(self._first_rows)
        return self._transitions(self._flat_rows.index_select(0, indices.view(-1)).view(*ages.shape, -1))

    def latest(self, steps: int) -> Transitions:
        """The last `steps` transitions [A, steps, ...] in the order in which they were added."""
        if steps > self.size:
            raise ValueError(f"the last {steps} of {self.size} transitions")
        device = self._rows.device
        indices = torch.arange(self._added - steps, self._added, device=device).remainder_(self.capacity)
        return self._transitions(self._rows[:, indices])

    def _transitions(self, rows: Tensor) -> Transitions:
        observation, action, next_observation, task_reward = rows.split(self._split, dim=-1)
        return Transitions(observation, action, next_observation, task_reward.squeeze(-1))

    def state_dict(self, agent: int) -> dict[str, Tensor]:
        """Everything that an exact resume of one agent needs, alone or among others."""
        return {"rows": self._rows[agent, : self.size], "counts": torch.tensor([self._added, self._sampled])}

    def load_state_dict(self, agent: int, state: dict[str, Tensor]) -> None:
        """Restore what `state_dict` gave into a memory of the same capacity; all agents have to be in step."""
        self._added, self._sampled = (int(count) for count in state["counts"])
        self.size = min(self._added, self.capacity)
        self._rows[agent, : self.size] = state["rows"].to(self._rows.device)
