"""A point in the plane that steers and picks its speed: tasks are goals, the common sense is a speed.

State (x, y, cos heading, sin heading), which says nothing about the goal; action (a_1, a_2) in [-1, 1]^2:

    heading' = heading + a_1 TURN,   speed = (1 + a_2) / 2 m/s,   position' = position + speed STEP (cos, sin)(heading')

    r_task = -TASK_SLOPE |position' - goal|            differs by task
    r_cs   = -CS_WEIGHT (speed - SPEED_TARGET)^2       the same in all tasks

Heading and speed rather than a velocity vector, because the soft-optimal policy of a speed target is then unimodal in
the action nearly everywhere, and a squashed Gaussian can be one; in a velocity vector it is a ring.
"""

from collections.abc import Sequence

import numpy as np
import torch
from torch import Tensor

from mtcsirl.episodes.lockstep import Outcome
from mtcsirl.transitions import Transitions

STATE_SIZE, ACTION_SIZE = 4, 2
STEP = 0.1
"""Seconds per step."""
TURN = 1.0
"""Largest turn per step in radians."""
TASK_SLOPE = 2.0
"""Task reward lost per metre of distance from the goal."""
SPEED_TARGET = 0.8
"""m/s."""
CS_WEIGHT = 20.0
"""Common-sense reward lost per (m/s)^2: at temperature 1 a standard deviation of 0.16 m/s."""
EPISODE_STEPS = 50
ARRIVED = 0.2
"""An episode counts as solved where its last distance from the goal, in metres, is below this."""

Goal = tuple[float, float]


def move(state: np.ndarray, action: np.ndarray) -> np.ndarray:
    """States [..., 4] and actions [..., 2] -> next states [..., 4]."""
    heading = np.arctan2(state[..., 3], state[..., 2]) + TURN * action[..., 0]
    forward = np.stack((np.cos(heading), np.sin(heading)), axis=-1)
    speed = (1.0 + action[..., 1:]) / 2.0
    return np.concatenate((state[..., :2] + STEP * speed * forward, forward), axis=-1)


def task_reward(next_state: np.ndarray, goal: np.ndarray) -> np.ndarray:
    """r_task [...] of next states [..., 4] for goals [..., 2]."""
    return np.asarray(-TASK_SLOPE * np.linalg.norm(next_state[..., :2] - goal, axis=-1))


def speed(transitions: Transitions) -> Tensor:
    """Speed [...] in m/s, read from the positions before and after."""
    metres: Tensor = (transitions.next_observation[..., :2] - transitions.observation[..., :2]).norm(dim=-1)
    return metres / STEP


def common_sense_reward(transitions: Transitions) -> Tensor:
    """r_cs [...]."""
    return -CS_WEIGHT * (speed(transitions) - SPEED_TARGET).square()


def random_states(count: int, random: np.random.Generator) -> np.ndarray:
    """States [count, 4]: positions uniform in the square of half side 1, headings uniform."""
    heading = random.uniform(-np.pi, np.pi, count)
    return np.column_stack((random.uniform(-1.0, 1.0, (count, 2)), np.cos(heading), np.sin(heading)))


def uniform_transitions(count: int, goal: Goal, random: np.random.Generator) -> Transitions:
    """Transitions [count] from random states under uniform actions, with the task reward of ``goal``."""
    state, action = random_states(count, random), random.uniform(-1.0, 1.0, (count, ACTION_SIZE))
    following = move(state, action)
    return as_transitions(state, action, following, task_reward(following, np.array(goal)))


def as_transitions(*columns: np.ndarray) -> Transitions:
    """Arrays (s, a, s', r_task) as float32 tensors."""
    return Transitions(*(torch.from_numpy(np.asarray(column, dtype=np.float32)) for column in columns))


class PointMasses:
    """One point per goal, stepped together; start states are random."""

    def __init__(self, goals: Sequence[Goal], seed: int) -> None:
        self._goals = np.array(goals)
        self._random = np.random.default_rng(seed)
        self._state = random_states(len(goals), self._random)

    def reset(self) -> np.ndarray:
        """First observations [A, 4]."""
        self._state = random_states(len(self._goals), self._random)
        return self._state.astype(np.float32)

    def step(self, action: np.ndarray) -> Outcome:
        """Apply actions [A, 2]; success is to be near the goal."""
        self._state = move(self._state, np.asarray(action, dtype=np.float64))
        reward = task_reward(self._state, self._goals)
        near = reward > -TASK_SLOPE * ARRIVED
        return Outcome(self._state.astype(np.float32), reward.astype(np.float32), near, np.zeros(len(near), dtype=bool))

    def close(self) -> None:
        """Nothing to free."""
