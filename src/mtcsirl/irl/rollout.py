"""What the generators do in their environments."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import torch
from torch import Tensor

from mtcsirl.episodes.lockstep import Environments, Outcome
from mtcsirl.transitions import RewardFunction, Transitions


@dataclass(frozen=True)
class World:
    """The T tasks of an IRL run and how to measure what happens in them; all functions take what the agent sees."""

    members: tuple[tuple[str, int], ...]
    """(task, target) of each environment."""
    environments: Environments
    truth: RewardFunction
    """The ground-truth cs-reward: for diagnostics alone, nothing is trained on it."""
    measure_episode: Callable[[np.ndarray, np.ndarray, np.ndarray, bool], dict[str, float]]
    """(action [n, A], next observation [n, O], task reward [n], solved) of one episode -> metrics by name."""


Act = Callable[[np.ndarray], np.ndarray]
"""Observations [T, O] -> actions [T, A]."""
OnStep = Callable[[np.ndarray, np.ndarray, Outcome], None]
"""(observation [T, O], action [T, A], outcome) of one environment step."""


class Flags(NamedTuple):
    """What happened in each step of T environments, [T, steps] each."""

    success: np.ndarray
    diverged: np.ndarray
    """The simulation diverged in this step, and its environment started over."""


def collect(environments: Environments, act: Act, steps: int, episode_steps: int, on_step: OnStep) -> Flags:
    """``steps`` steps in every environment, from a reset and with one every ``episode_steps``.

    Starting each iteration from a reset ("sample trajectories" in Algorithms 1 and 2) leaves nothing of the simulator
    to save between iterations.
    """
    flags = []
    observation = np.empty(0)
    for step in range(steps):
        if step % episode_steps == 0:
            observation = environments.reset()
        action = act(observation)
        outcome = environments.step(action)
        on_step(observation, action, outcome)
        flags.append((outcome.success, outcome.diverged))
        observation = outcome.next_observation
    return Flags(*(np.stack(column, axis=1) for column in zip(*flags, strict=True)))


def gather(transitions: Transitions, index: Tensor) -> Transitions:
    """Rows ``index`` [T, B] of transitions [T, N]: transitions [T, B]."""
    task = torch.arange(index.shape[0], device=index.device).unsqueeze(1)
    return Transitions(*(part[task, index] for part in transitions))
