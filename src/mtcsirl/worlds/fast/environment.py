"""What every Meta-World task shares, done with less work."""

import math
from functools import cached_property
from typing import Any

import mujoco
import numpy as np
from metaworld.sawyer_xyz_env import SawyerXYZEnv

from mtcsirl.worlds.fast.models import fresh_simulation
from mtcsirl.worlds.fast.snapshot import Snapshot

_GRIPPER_QUATERNION = (1.0, 0.0, 1.0, 0.0)
_BAD_STATE = slice(mujoco.mjtWarning.mjWARN_BADQPOS, mujoco.mjtWarning.mjWARN_BADCTRL + 1)


class FastEnvironment(SawyerXYZEnv):
    """Laid over a task's class, steps and resets as the task alone does, bit for bit, only faster.

    Names are looked up once, the observation is written into one array, contacts are filtered by numpy and, since the
    target is fixed, a reset restores what the first reset ended in. Forces that only an observation with force sensors
    needs (``mj_rnePostConstraint``) are not computed, and the target's site is not moved before a step of the
    simulation that places it anyway.
    """

    _initialize_simulation = fresh_simulation

    def __init__(self) -> None:
        self._positions: dict[tuple[str, str], np.ndarray] = {}
        self._first_reset: Snapshot | None = None
        super().__init__()
        self._pad_geoms = tuple(self.model.geom(name).id for name in ("leftpad_geom", "rightpad_geom"))
        self._mocap, self._grip = self.data.mocap_pos[0], self.data.ctrl
        self._divergences = self.data.warning.number[_BAD_STATE]

    @cached_property
    def _hand(self) -> np.ndarray:
        return self._position("body", "hand")

    @cached_property
    def _right_claw(self) -> np.ndarray:
        return self._position("body", "rightclaw")

    @cached_property
    def _left_claw(self) -> np.ndarray:
        return self._position("body", "leftclaw")

    @cached_property
    def _right_finger(self) -> np.ndarray:
        return self._position("site", "rightEndEffector")

    @cached_property
    def _left_finger(self) -> np.ndarray:
        return self._position("site", "leftEndEffector")

    def fix_target(self, vector: np.ndarray) -> None:
        """Fix the target and show it in the observation; what ``set_task`` does, without its pickle."""
        self._set_task_called = True
        self._freeze_rand_vec = True
        self._last_rand_vec = vector.copy()
        self._partially_observable = False
        del self.sawyer_observation_space
        space = self.sawyer_observation_space
        self._low, self._high = space.low, space.high
        self._first_reset = None

    @property
    def diverged(self) -> bool:
        """Whether MuJoCo met a state that is not finite or too large since the last reset, and started over."""
        return bool(np.count_nonzero(self._divergences))

    def reset(
        self, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[np.ndarray, dict[str, Any]]:
        """Return the first observation [39] and an empty dictionary."""
        if self._first_reset is None:
            observation, _ = super().reset()
            self._first_reset = Snapshot()
            self._first_reset.take(self, observation)
        return self._first_reset.restore(self), {}

    def step(self, action: np.ndarray) -> tuple[np.ndarray, float, bool, bool, dict[str, Any]]:  # type: ignore[override]
        """Apply an action [4] for 5 steps of the simulation."""
        if self.curr_path_length >= self.max_path_length:
            raise ValueError("the episode has ended: call reset()")
        self.set_xyz_action(action[:3])
        self._grip[:] = (action[3], -action[3])
        self._simulate()
        self.curr_path_length += 1
        observation = self._get_obs()
        np.maximum(observation, self._low, out=observation)
        np.minimum(observation, self._high, out=observation)
        reward, info = self.evaluate_state(observation, action)
        return observation, reward, False, self.curr_path_length == self.max_path_length, info

    def _simulate(self) -> None:
        mujoco.mj_step(self.model, self.data, nstep=self.frame_skip)
        # Places bodies and contacts after the last step, and sets the solver's warm start for the next.
        mujoco.mj_forward(self.model, self.data)

    def set_xyz_action(self, action: np.ndarray) -> None:
        """Move the mocap body, to which the hand is welded, by the action [3] in centimetres."""
        move = np.minimum(np.maximum(action, -1), 1) * self.action_scale
        np.add(self._mocap, move, out=self._mocap)
        np.maximum(self._mocap, self.mocap_low, out=self._mocap)
        np.minimum(self._mocap, self.mocap_high, out=self._mocap)
        self.data.mocap_quat[0] = _GRIPPER_QUATERNION

    def get_body_com(self, body_name: str) -> np.ndarray:
        """Return the position [3] of a body, a view that follows it."""
        return self._position("body", body_name)

    def get_endeff_pos(self) -> np.ndarray:
        """Return the position [3] of the hand, a view that follows it."""
        return self._hand

    @property
    def tcp_center(self) -> np.ndarray:
        """The point [3] between the two fingers."""
        centre: np.ndarray = (self._right_finger + self._left_finger) / 2.0
        return centre

    def touching_object(self, object_geom_id: int) -> bool:
        """Return whether both pads of the gripper press on the object."""
        contact = self.data.contact
        of_object = (contact.geom == object_geom_id).any(axis=1)
        return bool(of_object.any()) and all(self._pressure(pad, of_object) > 0 for pad in self._pad_geoms)

    def _pressure(self, pad: int, of_object: np.ndarray) -> float:
        contact = self.data.contact
        addresses = contact.efc_address[of_object & (contact.geom == pad).any(axis=1)]
        pressure: float = sum(self.data.efc_force[address] for address in addresses)
        return pressure

    def _get_site_pos(self, site_name: str) -> np.ndarray:
        return self._position("site", site_name).copy()

    def _get_curr_obs_combined_no_goal(self) -> np.ndarray:
        between = self._right_claw - self._left_claw
        frame = np.zeros(18)
        frame[0:3] = self._hand
        frame[3] = min(math.sqrt(between.dot(between)) / 0.1, 1.0)
        positions, quaternions = self._get_pos_objects(), self._get_quat_objects()
        for i in range(len(positions) // 3):
            frame[4 + 7 * i : 7 + 7 * i] = positions[3 * i : 3 * i + 3]
            frame[7 + 7 * i : 11 + 7 * i] = quaternions[4 * i : 4 * i + 4]
        return frame

    def _get_obs(self) -> np.ndarray:
        frame = self._get_curr_obs_combined_no_goal()
        observation = np.zeros(39)
        observation[:18] = frame
        observation[18:36] = self._prev_obs
        if not self._partially_observable:
            observation[36:] = self._target_pos
        self._prev_obs = frame
        return observation

    def _position(self, kind: str, name: str) -> np.ndarray:
        """Return the live position [3] of a named body or site."""
        key = kind, name
        if key not in self._positions:
            self._positions[key] = getattr(self.data, kind)(name).xpos
        return self._positions[key]
