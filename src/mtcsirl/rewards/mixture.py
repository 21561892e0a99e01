"""The reward that a policy is trained on, computed on sampled transitions: r_task + alpha f."""

from __future__ import annotations

from collections.abc import Hashable, Sequence
from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor

from mtcsirl.rewards.adapter import GroundTruth
from mtcsirl.rewards.curriculum import R_MAX, Alpha
from mtcsirl.transitions import RewardFunction, Transitions


def mixed(task_reward: Tensor, f: Tensor, alpha: Tensor) -> Tensor:
    """r_task + alpha f (section 3.3), of agents and of generators: [A, B], [A, B], [A, 1] -> [A, B]."""
    return task_reward + alpha * f


@dataclass(frozen=True)
class RewardMixture:
    """What one agent is rewarded for: scale x (r_task + alpha f), alpha = cs_weight x r_ave / R_MAX or cs_weight alone.

    f and r_task are reward functions of transitions; without `f` the task reward stands alone, without
    `task_reward` it is the one that the environment paid. `curriculum`: whether r_ave / R_MAX counts.
    """

    scale: float = 1.0
    cs_weight: float = 0.0
    curriculum: bool = False
    f: RewardFunction | None = None
    task_reward: RewardFunction | None = None


class PolicyReward:
    """The rewards [A, B] of the sampled transitions of A agents, each by its own mixture."""

    def __init__(
        self,
        mixtures: Sequence[RewardMixture],
        device: torch.device | str = "cpu",
        *,
        window: int = 256,
        maximum: float = R_MAX,
    ) -> None:
        """`window` and `maximum`: of the curriculum, see `Curriculum`."""
        self._scale = torch.tensor([[mixture.scale] for mixture in mixtures], device=device)
        weights, uses = [mixture.cs_weight for mixture in mixtures], [mixture.curriculum for mixture in mixtures]
        self.alpha = Alpha(weights, uses, window, maximum)
        apart = torch.device(device).type == "cpu"
        self._f = _group([mixture.f for mixture in mixtures], apart)
        self._task_reward = _group([mixture.task_reward for mixture in mixtures], apart)
        self.counts = np.ones(len(mixtures), dtype=bool)
        """[A]; False while f does not count for an agent, because it learns its task first."""

    @torch.no_grad()
    def __call__(self, transitions: Transitions) -> Tensor:
        """scale x (r_task + alpha f) [A, B]."""
        total = transitions.task_reward
        if self._task_reward:
            total = _apply(self._task_reward, transitions, total, np.ones_like(self.counts))
        if self._f and self.counts.any():
            f = _apply(self._f, transitions, torch.zeros_like(total), self.counts)
            alpha = self.alpha() * torch.from_numpy(self.counts)
            total = mixed(total, f, alpha[:, None].to(total.device))
        return self._scale * total


_Groups = list[tuple[RewardFunction, list[int]]]


def _group(functions: Sequence[RewardFunction | None], apart: bool) -> _Groups:
    """The functions with the agents that each is called for at once.

    `apart`: with one agent at a time. A matrix product rounds as its number of rows wants, so a learned reward of one
    agent's minibatch has other bits than the same rows among those of others. An accelerator promises no equal bits,
    and there a function that agents share is called once.
    """
    groups: dict[Hashable, tuple[RewardFunction, list[int]]] = {}
    for agent, function in enumerate(functions):
        if function is not None:
            shared: Hashable = function if isinstance(function, GroundTruth) else id(function)
            groups.setdefault(agent if apart else shared, (function, []))[1].append(agent)
    return list(groups.values())


def _apply(groups: _Groups, transitions: Transitions, otherwise: Tensor, wanted: np.ndarray) -> Tensor:
    """The functions' rewards [A, B] for the `wanted` agents, elsewhere `otherwise` [A, B]."""
    if len(groups) == 1 and len(groups[0][1]) == len(otherwise) and wanted.all():
        return groups[0][0](transitions)
    values = otherwise.clone()
    for function, agents in groups:
        own = [agent for agent in agents if wanted[agent]]
        if own:
            pick = slice(own[0], own[0] + 1) if len(own) == 1 else own
            values[pick] = function(Transitions(*(tensor[pick] for tensor in transitions)))
    return values
