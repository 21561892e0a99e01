"""The curriculum of section 3.3: how much f weighs in the policy reward, of experts and of generators."""

from collections.abc import Sequence

import torch
from torch import Tensor

R_MAX = 10.0
"""The task reward lies in [0, R_MAX]; Meta-World's rewards do with 10."""
_SMALLEST = 1e-3
"""Below this an expert earns nothing, and any reward is as much as its own."""


class Curriculum:
    """min(1, r_ave / R_MAX), r_ave the mean task reward of an agent's last ``window`` environment steps.

    One weight per agent. It acts on the policy reward r_task + alpha f only, never on a discriminator; before the first
    step it is 0.
    """

    def __init__(self, agents: int, window: int = 256, maximum: Tensor | float = R_MAX) -> None:
        """``maximum``: R_MAX, one for all or one per agent [agents]."""
        self._rewards = torch.zeros(agents, window)
        self._maximum = torch.as_tensor(maximum).clamp(_SMALLEST, R_MAX)
        self._steps = torch.zeros((), dtype=torch.int64)

    def add(self, task_reward: Tensor) -> None:
        """Note the unscaled task rewards [agents] of one environment step."""
        self._rewards[:, int(self._steps) % self._rewards.shape[1]] = task_reward
        self._steps += 1

    def weight(self) -> Tensor:
        """The weight of each agent [agents], in [0, 1] where rewards are not negative."""
        filled = max(1, min(int(self._steps), self._rewards.shape[1]))
        return (self._rewards[:, :filled].mean(dim=1) / self._maximum).clamp(max=1.0)

    def state(self, agent: int) -> dict[str, Tensor]:
        """The tensors that the checkpoint of one agent needs (not copies)."""
        return {"rewards": self._rewards[agent], "steps": self._steps}


class Alpha:
    """alpha, the factor on f in the reward of each of A agents: cs_weight, times its curriculum if it has one."""

    def __init__(
        self, cs_weight: Sequence[float], curriculum: Sequence[bool], window: int, maximum: Tensor | float
    ) -> None:
        """``window`` and ``maximum``: as in ``Curriculum``."""
        self._cs_weight = torch.tensor(list(cs_weight))
        self._least = torch.tensor([float(not uses) for uses in curriculum])
        self.curriculum = Curriculum(len(cs_weight), window, maximum) if any(curriculum) else None

    def add(self, task_reward: Tensor) -> None:
        """Note the unscaled task rewards [A] of one environment step."""
        if self.curriculum is not None:
            self.curriculum.add(task_reward)

    def __call__(self) -> Tensor:
        """alpha [A]."""
        if self.curriculum is None:
            return self._cs_weight
        return self._cs_weight * torch.maximum(self._least, self.curriculum.weight())

    def state_dict(self, agent: int) -> dict[str, Tensor]:
        """The tensors that the checkpoint of one agent needs (not copies): none for an agent without a curriculum."""
        if self.curriculum is None or self._least[agent] > 0:
            return {}
        return self.curriculum.state(agent)

    def load_state_dict(self, agent: int, state: dict[str, Tensor]) -> None:
        """Restore what ``state_dict`` gave."""
        for name, tensor in self.state_dict(agent).items():
            tensor.copy_(state[name])
