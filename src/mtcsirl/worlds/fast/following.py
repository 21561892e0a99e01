"""Meta-World's own ``set_task`` on a fast environment.

Not in the body of ``FastEnvironment``: no run calls it, and a change of the body would be one of every run's identity.
"""

from typing import Any

from metaworld.sawyer_xyz_env import SawyerXYZEnv
from metaworld.types import Task


def _set_task(self: Any, task: Task) -> None:
    """Fix the target that ``task`` has; the next reset goes there."""
    SawyerXYZEnv.set_task(self, task)
    space = self.sawyer_observation_space
    self._low, self._high = space.low, space.high
    self._first_reset = None


def follow_set_task(environment_class: type[SawyerXYZEnv]) -> None:
    """Let a class whose reset restores a snapshot take a new one after ``set_task``."""
    environment_class.set_task = _set_task  # type: ignore[method-assign]
