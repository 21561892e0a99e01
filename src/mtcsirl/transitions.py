"""What every reward function and discriminator reads: a batch of transitions."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, NamedTuple

if TYPE_CHECKING:
    import torch
    from torch import Tensor


class Transitions(NamedTuple):
    """Transitions (s, a, s') with the known task reward.

    ``observation`` and ``next_observation`` are [..., 39] as the agent sees them (mapped or raw, see
    ``environment.observation``), ``action`` [..., 4] in [-1, 1], ``task_reward`` [...] in [0, 10]. The leading
    dimensions are [agents, minibatch] wherever several agents train in one process.
    """

    observation: Tensor
    action: Tensor
    next_observation: Tensor
    task_reward: Tensor

    def to(self, device: torch.device | str) -> Transitions:
        """The same on another device; not a copy where they are there already."""
        return Transitions(*(part.to(device) for part in self))


RewardFunction = Callable[[Transitions], "Tensor"]
"""Maps transitions [..., *] to rewards [...]."""
