"""The reward that a policy is trained on, computed on sampled transitions."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import torch
from torch import Tensor

from mtcsirl.rewards.curriculum import Curriculum
from mtcsirl.rewards.ground_truth import COMMON_SENSE_REWARDS
from mtcsirl.transitions import RewardFunction, Transitions
from mtcsirl.worlds.environments import OBSERVATION_MAPS


def ground_truth(cs_reward: str, observation: str) -> RewardFunction:
    """The ground-truth cs-reward of transitions as the agent sees them: the observation map is inverted first."""
    reward, seen = COMMON_SENSE_REWARDS[cs_reward], OBSERVATION_MAPS[observation]

    def on_seen(transitions: Transitions) -> Tensor:
        return reward(
            transitions._replace(
                observation=seen.invert(transitions.observation),
                next_observation=seen.invert(transitions.next_observation),
            )
        )

    return on_seen


@dataclass(frozen=True)
class RewardMixture:
    """What one agent is rewarded for: scale x (r_task + cs_weight x alpha x f).

    f and r_task are reward functions of transitions; without `f` the task reward stands alone, without
    `task_reward` it is the one that the environment paid. alpha = r_ave / R_MAX with `curriculum`, else 1.
    """

    scale: float = 1.0
    cs_weight: float = 0.0
    curriculum: bool = False
    f: RewardFunction | None = None
    task_reward: RewardFunction | None = None


class PolicyReward:
    """The rewards [A, B] of the sampled transitions of A agents, each by its own mixture."""

    def __init__(self, mixtures: Sequence[RewardMixture], device: torch.device | str) -> None:
        agents = len(mixtures)
        self._scale = torch.tensor([[mixture.scale] for mixture in mixtures], device=device)
        self._cs_weight = torch.tensor([[mixture.cs_weight] for mixture in mixtures], device=device)
        self._constant = torch.tensor([float(not mixture.curriculum) for mixture in mixtures])
        self.curriculum = Curriculum(agents) if any(mixture.curriculum for mixture in mixtures) else None
        self._f = _group([mixture.f for mixture in mixtures])
        self._task_reward = _group([mixture.task_reward for mixture in mixtures])
        self.counts = torch.ones(agents, device=device)
        """[A]; 0 while f does not count for an agent, because it learns its task first."""

    @torch.no_grad()
    def __call__(self, transitions: Transitions) -> Tensor:
        """scale x (r_task + cs_weight x alpha x f) [A, B]."""
        total = transitions.task_reward
        if self._task_reward:
            total = _apply(self._task_reward, transitions, otherwise=total)
        if self._f and self.counts.any():
            f = _apply(self._f, transitions, otherwise=torch.zeros_like(total))
            total = total + self._weight() * f
        return self._scale * total

    def _weight(self) -> Tensor:
        weight = self._cs_weight * self.counts[:, None]
        if self.curriculum is None:
            return weight
        alpha = torch.maximum(self._constant, self.curriculum.weight())
        return weight * alpha[:, None].to(weight.device)


_Groups = list[tuple[RewardFunction, list[int]]]


def _group(functions: Sequence[RewardFunction | None]) -> _Groups:
    """The distinct functions, each with the agents that use it: agents that share one are computed together."""
    groups: dict[int, tuple[RewardFunction, list[int]]] = {}
    for agent, function in enumerate(functions):
        if function is not None:
            groups.setdefault(id(function), (function, []))[1].append(agent)
    return list(groups.values())


def _apply(groups: _Groups, transitions: Transitions, otherwise: Tensor) -> Tensor:
    if len(groups) == 1 and len(groups[0][1]) == len(otherwise):
        return groups[0][0](transitions)
    values = otherwise.clone()
    for function, agents in groups:
        values[agents] = function(Transitions(*(tensor[agents] for tensor in transitions)))
    return values
