"""One factory: task and target in, gymnasium environment out.

The environment is Meta-World's with its target fixed, its observation in float32 and, by default, mapped; an episode
always lasts 500 steps, whether the task succeeds or not.
"""

from dataclasses import dataclass
from typing import Any, TypeVar

import gymnasium
import numpy as np
import torch
from gymnasium.spaces import Box

from mtcsirl.errors import UserError
from mtcsirl.names import TARGETS_PER_TASK, TASKS
from mtcsirl.worlds.fast import FastEnvironment, make_fast_environment
from mtcsirl.worlds.rendering import SceneRenderer

OBSERVATION_SIZE = 39
ACTION_SIZE = 4
EPISODE_STEPS = 500
STEP_SECONDS = 0.0125
"""Time between two observations: frame_skip 5 times the simulator's time step of 0.0025 s."""

PICTURE_SIZE = 480

HAND = slice(0, 3)
CURRENT = slice(0, 18)
PREVIOUS = slice(18, 36)
GOAL = slice(36, 39)

Array = TypeVar("Array", np.ndarray, torch.Tensor)


@dataclass(frozen=True)
class ObservationMap:
    """What the agent sees of Meta-World's observation; this one, ``raw``, changes nothing.

    Both directions take numpy arrays or torch tensors [..., 39] and keep their dtype and device. Raw layout, in metres:
    0:3 hand, 3 gripper opening in [0, 1], 4:18 objects (position, quaternion, twice), 18:36 the same one step earlier,
    36:39 goal.
    """

    name: str

    def apply(self, raw: Array) -> Array:
        """Return what the agent sees of the raw observation [..., 39]."""
        return raw

    def invert(self, mapped: Array) -> Array:
        """Return the raw observation [..., 39] of what the agent sees."""
        return mapped


@dataclass(frozen=True)
class VelocityMap(ObservationMap):
    """Show velocities: the previous frame becomes ``100 (current - previous)``, positions are centred and scaled.

    Positions of two successive frames differ by less than 0.01 m, which a network hardly tells from none; mapped, the
    hand's full speed of 0.8 m/s reads 1. Positions are in decimetres from the middle of the workspace. The map is
    affine and invertible, so that no information is lost or gained.
    """

    def apply(self, raw: Array) -> Array:
        """Return the mapped observation [..., 39]."""
        centre, scale = _constants(raw)
        mapped: Array = (raw - centre) * scale
        mapped[..., PREVIOUS] = (raw[..., CURRENT] - raw[..., PREVIOUS]) * _RATE
        return mapped

    def invert(self, mapped: Array) -> Array:
        """Return the raw observation [..., 39], exact to rounding: 1e-7 m in float32."""
        centre, scale = _constants(mapped)
        raw: Array = mapped / scale + centre
        raw[..., PREVIOUS] = raw[..., CURRENT] - mapped[..., PREVIOUS] / _RATE
        return raw


_RATE = 100.0


def _centre_and_scale() -> tuple[np.ndarray, np.ndarray]:
    """Per entry of the raw observation. The second object's slot is zero in most tasks and stays zero: no centre."""
    centre, scale = np.zeros(OBSERVATION_SIZE), np.ones(OBSERVATION_SIZE)
    for position in (HAND, slice(4, 7), GOAL):
        centre[position] = (0.0, 0.7, 0.15)
    for position in (HAND, slice(4, 7), slice(11, 14), GOAL):
        scale[position] = 10.0
    centre[3], scale[3] = 0.5, 2.0
    return centre, scale


_CENTRE, _SCALE = _centre_and_scale()


def _constants(like: Array) -> tuple[Array, Array]:
    """Return centre and scale [39] as arrays of the same kind, dtype and device as ``like``."""
    if isinstance(like, torch.Tensor):
        return torch.as_tensor(_CENTRE).to(like), torch.as_tensor(_SCALE).to(like)
    return _CENTRE.astype(like.dtype, copy=False), _SCALE.astype(like.dtype, copy=False)


OBSERVATION_MAPS: dict[str, ObservationMap] = {
    "mapped": VelocityMap("mapped"),
    "raw": ObservationMap("raw"),
}
"""The settings of ``environment.observation``."""


class TaskEnvironment(gymnasium.Env[np.ndarray, np.ndarray]):
    """A Meta-World task with a fixed target; see ``make_environment``.

    Resets are identical, whatever seed they are given: nothing in the environment is random.
    """

    metadata: dict[str, Any] = {"render_modes": ["rgb_array"], "render_fps": 80}  # noqa: RUF012

    def __init__(self, simulator: FastEnvironment, observation_map: ObservationMap, render: bool) -> None:
        self.simulator = simulator
        self.observation_map = observation_map
        self.observation_space = Box(-np.inf, np.inf, (OBSERVATION_SIZE,), np.float32)
        self.action_space = Box(-1.0, 1.0, (ACTION_SIZE,), np.float32)
        self.render_mode = "rgb_array" if render else None
        self._renderer = SceneRenderer(simulator.model, width=PICTURE_SIZE, height=PICTURE_SIZE) if render else None

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[np.ndarray, dict[str, Any]]:
        """Return the first observation [39] and an empty dictionary."""
        super().reset(seed=seed)
        observation, _ = self.simulator.reset()
        return self._seen(observation), {}

    def step(self, action: np.ndarray) -> tuple[np.ndarray, float, bool, bool, dict[str, Any]]:
        """Apply an action [4] in [-1, 1] for 0.0125 s.

        Returns:
            The observation [39], the task's reward in [0, 10], terminated (always False), truncated (True at step 500)
            and info: ``success``, whether the task is solved at this step; ``diverged``, whether the simulation blew up
            in this episode (MuJoCo then starts over from its default state, so its transitions mean nothing).
        """
        observation, reward, _, truncated, info = self.simulator.step(action)
        report = {"success": bool(info["success"]), "diverged": self.simulator.diverged}
        return self._seen(observation), float(reward), False, truncated, report

    def render(self) -> np.ndarray:
        """Return the picture [480, 480, 3] of the camera ``corner2``, the right way up.

        Raises:
            UserError: the environment was made without ``render=True``.
        """
        if self._renderer is None:
            raise UserError("this environment cannot render: make it with render=True")
        return self._renderer.render(self.simulator.data)

    def close(self) -> None:
        """Free the rendering context."""
        if self._renderer is not None:
            self._renderer.close()
            self._renderer = None

    def _seen(self, observation: np.ndarray) -> np.ndarray:
        # Mapped in float64 and rounded once: the difference of two frames keeps its digits.
        return self.observation_map.apply(observation).astype(np.float32)


def make_environment(
    task: str, target: int, *, observation: str = "mapped", target_seed: int = 0, render: bool = False
) -> TaskEnvironment:
    """Return the environment of one task and one target.

    Args:
        task: one of Meta-World's 50 tasks, without its version suffix, for example ``reach-wall``.
        target: index into ``metaworld.MT1(task + "-v3", seed=target_seed).train_tasks``.
        observation: key of ``OBSERVATION_MAPS``.
        target_seed: the seed from which Meta-World draws the 50 targets.
        render: make ``render()`` work; needs OSMesa (Debian: libosmesa6) where there is no screen.

    Raises:
        UserError: unknown task, target or observation; rendering without OSMesa.
    """
    if task not in TASKS:
        raise UserError(f"task: unknown task '{task}'; Meta-World has {', '.join(sorted(TASKS))}")
    if not 0 <= target < TARGETS_PER_TASK:
        raise UserError(f"target: {target} is not one of the targets 0 to {TARGETS_PER_TASK - 1} of {task}")
    if observation not in OBSERVATION_MAPS:
        raise UserError(f"observation: unknown map '{observation}'; choose {' or '.join(OBSERVATION_MAPS)}")
    simulator = make_fast_environment(task, target, target_seed)
    return TaskEnvironment(simulator, OBSERVATION_MAPS[observation], render)
