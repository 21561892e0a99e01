"""The curriculum of section 3.3: how much the learned reward weighs in the policy reward."""

import torch
from torch import Tensor

R_MAX = 10.0
"""The task reward lies in [0, R_MAX]; Meta-World's rewards do with 10."""
_SMALLEST = 1e-3
"""Below this an expert earns nothing, and any reward is as much as its own."""


class Curriculum:
    """alpha = min(1, r_ave / R_MAX), r_ave the mean task reward of the generator's last ``window`` environment steps.

    One weight per generator. It acts on the policy reward r_task + alpha f only, never on the discriminator; before
    the first step it is 0.
    """

    def __init__(self, agents: int, window: int = 256, maximum: Tensor | float = R_MAX) -> None:
        """``maximum``: R_MAX, one for all or one per generator [agents]."""
        self._rewards = torch.zeros(agents, window)
        self._maximum = torch.as_tensor(maximum).clamp(_SMALLEST, R_MAX)
        self._steps = torch.zeros((), dtype=torch.int64)

    def add(self, task_reward: Tensor) -> None:
        """Note the unscaled task rewards [agents] of one environment step."""
        self._rewards[:, int(self._steps) % self._rewards.shape[1]] = task_reward
        self._steps += 1

    def weight(self) -> Tensor:
        """The weight of each generator [agents], in [0, 1] where rewards are not negative."""
        filled = max(1, min(int(self._steps), self._rewards.shape[1]))
        return (self._rewards[:, :filled].mean(dim=1) / self._maximum).clamp(max=1.0)

    def state(self) -> dict[str, Tensor]:
        """The tensors that a checkpoint needs (not copies)."""
        return {"rewards": self._rewards, "steps": self._steps}
