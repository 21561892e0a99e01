"""Replay memory of several agents that step together; rewards are computed when transitions are sampled."""

from __future__ import annotations

import numpy as np
import torch
from torch import Tensor

from mtcsirl.transitions import Transitions


class Replay:
    """The last `capacity` transitions of A agents, one row [s, a, s', r_task] each, float32.

    It holds the task reward as the environment gave it and never a mixture: whoever samples applies the reward
    function of the moment to the sampled transitions, so a learned reward that has changed since counts at once.
    """

    def __init__(
        self,
        agents: int,
        capacity: int,
        *,
        seed: int,
        observation_size: int = 39,
        action_size: int = 4,
        device: str | torch.device = "cpu",
    ) -> None:
        """Allocate [A, capacity, 2 x observation + action + 1]; `seed` starts the stream that draws samples."""
        self.size = 0
        """Transitions per agent in memory."""
        self._added = 0
        self._split = (observation_size, action_size, observation_size, 1)
        self._rows = torch.zeros(agents, capacity, sum(self._split), device=device)
        self._flat_rows = self._rows.view(agents * capacity, -1)
        self._first_rows = torch.arange(0, agents * capacity, capacity, device=device)[:, None]
        self._generator = torch.Generator(device).manual_seed(seed)

    @property
    def capacity(self) -> int:
        """Transitions per agent that fit; older ones are overwritten."""
        return self._rows.shape[1]

    def add(
        self, observation: np.ndarray, action: np.ndarray, next_observation: np.ndarray, task_reward: np.ndarray
    ) -> None:
        """Add one transition per agent: [A, 39], [A, 4], [A, 39], [A]."""
        row = np.concatenate((observation, action, next_observation, task_reward[:, None]), axis=1, dtype=np.float32)
        self._rows[:, self._added % self.capacity] = torch.from_numpy(row)
        self._added += 1
        self.size = min(self._added, self.capacity)

    def sample(self, minibatch: int, recent: int | None = None) -> Transitions:
        """Uniform transitions [A, minibatch, ...], with replacement, of the last `recent` steps or of all.

        Raises ValueError when nothing was added yet.
        """
        if self.size == 0:
            raise ValueError("nothing to sample: the replay memory is empty")
        span = self.size if recent is None else min(recent, self.size)
        shape = (len(self._rows), minibatch)
        ages = torch.randint(1, span + 1, shape, generator=self._generator, device=self._rows.device)
        indices = (self._added - ages).remainder_(self.capacity).add_(self._first_rows)
        return self._transitions(self._flat_rows.index_select(0, indices.view(-1)).view(*shape, -1))

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

    def state_dict(self) -> dict[str, Tensor]:
        """Everything that an exact resume needs."""
        return {
            "rows": self._rows[:, : self.size],
            "added": torch.tensor(self._added),
            "generator": self._generator.get_state(),
        }

    def load_state_dict(self, state: dict[str, Tensor]) -> None:
        """Restore what `state_dict` gave into a memory of the same capacity."""
        self._added = int(state["added"])
        self.size = min(self._added, self.capacity)
        self._rows[:, : self.size] = state["rows"].to(self._rows.device)
        self._generator.set_state(state["generator"].cpu())
