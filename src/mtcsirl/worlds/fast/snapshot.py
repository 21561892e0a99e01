"""The state of an environment after its first reset."""

import mujoco
import numpy as np
from metaworld.sawyer_xyz_env import SawyerXYZEnv

_STATE = mujoco.mjtState.mjSTATE_INTEGRATION


class Snapshot:
    """What a reset leaves behind: the simulator's state, the task's attributes and the first observation.

    A reset of Meta-World simulates 100 steps of the hand. With a fixed target they always end in the same state, so
    that it can be kept and restored. The state is all that the next step depends on, solver warm start included;
    positions and contacts follow from it. Attributes are kept as they are: a step binds new values to them and changes
    none in place.
    """

    def take(self, environment: SawyerXYZEnv, observation: np.ndarray) -> None:
        """Keep the environment's state and its first observation [39]."""
        self._state = np.empty(mujoco.mj_stateSize(environment.model, _STATE))
        mujoco.mj_getState(environment.model, environment.data, self._state, _STATE)
        self._attributes = vars(environment).copy()
        self._observation = observation.copy()

    def restore(self, environment: SawyerXYZEnv) -> np.ndarray:
        """Bring the environment back to this state and return its first observation [39]."""
        model, data = environment.model, environment.data
        mujoco.mj_resetData(model, data)
        mujoco.mj_setState(model, data, self._state, _STATE)
        mujoco.mj_forward(model, data)
        mujoco.mj_setState(model, data, self._state, _STATE)  # mj_forward moved the solver's warm start
        vars(environment).update(self._attributes)
        return self._observation.copy()
