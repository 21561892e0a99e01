"""Soft-optimal policies of the point mass by value iteration: experts that are exact up to a grid.

What r_task + weight r_cs asks for depends on the distance d from the goal and the bearing b of the heading relative to
the direction of the goal alone, so a grid over (d, b) serves all goals. At temperature 1

    Q(d, b, a) = r(d, b, a) + gamma V(d', b'),   V = log mean_a exp Q,   pi(a | d, b) = exp(Q - V) / 4

with the mean over the cells of a grid of actions in [-1, 1]^2; V is interpolated linearly.
"""

import numpy as np
from scipy.sparse import csr_array
from scipy.special import logsumexp

from mtcsirl.validation.point_mass import CS_WEIGHT, SPEED_TARGET, STEP, TASK_SLOPE, TURN, Goal

FARTHEST, DISTANCES, BEARINGS = 3.0, 51, 24
TURNS, SPEEDS = 11, 16
SWEEPS = 80

Array = np.ndarray


def _cells(count: int) -> Array:
    """Centres of ``count`` equal cells of [-1, 1]."""
    return (np.arange(count) + 0.5) / count * 2.0 - 1.0


class Planner:
    """The soft-optimal policy of r_task + cs_weight / CS_WEIGHT r_cs at temperature 1, for every goal."""

    def __init__(self, discount: float, cs_weight: float = CS_WEIGHT) -> None:
        """``cs_weight`` 0 plans for the task alone."""
        self._discount, self._cs_weight = discount, cs_weight
        self._actions = np.stack(np.meshgrid(_cells(TURNS), _cells(SPEEDS), indexing="ij"), axis=-1).reshape(-1, 2)
        distance = np.linspace(0.0, FARTHEST, DISTANCES)
        bearing = np.arange(BEARINGS) / BEARINGS * 2.0 * np.pi
        grid = np.stack(np.meshgrid(distance, bearing, indexing="ij"), axis=-1).reshape(-1, 2)
        reward, corner, weight = self._outcomes(grid[:, 0], grid[:, 1])
        rows = np.arange(0, 4 * reward.size + 1, 4)
        flat = [np.moveaxis(part, 0, -1).ravel() for part in (weight, corner)]
        following = csr_array((*flat, rows), shape=(reward.size, len(grid)))
        self._value = np.zeros(len(grid), dtype=np.float32)
        for _ in range(SWEEPS):
            q = reward + discount * (following @ self._value).reshape(reward.shape)
            self._value = logsumexp(q, axis=1) - np.log(len(self._actions))

    def act(self, state: Array, goal: Goal | Array, random: np.random.Generator) -> Array:
        """Actions [N, 2] drawn in states [N, 4] with one goal or [N, 2] of them: a cell of the grid, uniform within."""
        to_goal = np.array(goal) - state[:, :2]
        heading = np.arctan2(state[:, 3], state[:, 2])
        bearing = heading - np.arctan2(to_goal[:, 1], to_goal[:, 0])
        reward, corner, weight = self._outcomes(np.linalg.norm(to_goal, axis=1), bearing)
        q = reward + self._discount * (weight * self._value[corner]).sum(axis=0)
        cell = (q + random.gumbel(size=q.shape)).argmax(axis=1)
        inside = random.uniform(-1.0, 1.0, (len(state), 2)) / (TURNS, SPEEDS)
        return np.asarray(self._actions[cell] + inside)

    def _outcomes(self, distance: Array, bearing: Array) -> tuple[Array, Array, Array]:
        """Of every action [C] in (distance, bearing) [N]: reward [N, C], corners of the grid and weights [4, N, C].

        In a frame whose x axis points at the goal from a point at the origin.
        """
        heading = bearing[:, None] + TURN * self._actions[:, 0]
        speed = (1.0 + self._actions[:, 1]) / 2.0
        x, y = distance[:, None] - STEP * speed * np.cos(heading), -STEP * speed * np.sin(heading)
        after = np.hypot(x, y)
        reward = -TASK_SLOPE * after - self._cs_weight * (speed - SPEED_TARGET) ** 2
        row = np.clip(after / FARTHEST * (DISTANCES - 1), 0.0, DISTANCES - 1.001)
        column = ((heading - np.arctan2(y, x)) / (2.0 * np.pi) * BEARINGS) % BEARINGS
        low, left = row.astype(np.int32), column.astype(np.int32) % BEARINGS
        up, right = (row - low).astype(np.float32), (column - np.floor(column)).astype(np.float32)
        beside = (left + 1) % BEARINGS
        corner = np.stack([r * BEARINGS + c for r in (low, low + 1) for c in (left, beside)])
        weight = np.stack([r * c for r in (1.0 - up, up) for c in (1.0 - right, right)])
        return reward.astype(np.float32), corner, weight
