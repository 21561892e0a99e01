"""Meta-World's hand-written policies as explorers, for tasks whose reward random actions never meet.

On push-back r_task stays at 0.02 until the gripper is closed around the puck, and below that lies a valley (one finger
past the puck pays 0.001). Off-policy learning needs to have seen what lies behind it, not to have found it.
"""

import warnings
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from mtcsirl.worlds.environments import OBSERVATION_MAPS

if TYPE_CHECKING:
    from metaworld.policies.policy import Policy


class ScriptedExplorers:
    """The first actions of A agents: clip(a_script(s) + noise x e, -1, 1), e ~ N(0, 1), each for its own steps.

    e depends on seed and step alone: nothing to save, and what agents in lockstep do leaves each other's alone.
    """

    def __init__(
        self,
        tasks: Sequence[str],
        seeds: Sequence[int],
        steps: Sequence[int],
        noise: Sequence[float],
        observation: str,
    ) -> None:
        """``steps``: environment steps for which each agent's actions are scripted, 0 for never.

        ``noise``: standard deviation of each one's noise, in units of the action.
        """
        self.steps = np.array(steps, dtype=np.int64)
        self._seeds, self._noise, self._seen = tuple(seeds), tuple(noise), OBSERVATION_MAPS[observation]
        self._policies = {index: _policy(task) for index, task in enumerate(tasks) if steps[index] > 0}

    def active(self, step: int) -> np.ndarray:
        """Whose action in this step is scripted [A]."""
        return step < self.steps

    def replace(self, action: np.ndarray, observation: np.ndarray, step: int) -> None:
        """Overwrite the rows of ``action`` [A, 4] of agents scripted in this step, given what they see [A, 39]."""
        for index, policy in self._policies.items():
            if step < self.steps[index]:
                raw = self._seen.invert(observation[index].astype(np.float64))
                with warnings.catch_warnings():
                    warnings.simplefilter("ignore")  # it asks for more than 1 and knows that this is clipped
                    scripted = np.clip(policy.get_action(raw), -1.0, 1.0)
                e = np.random.default_rng((self._seeds[index], step)).standard_normal(len(scripted))
                action[index] = np.clip(scripted + self._noise[index] * e, -1.0, 1.0)


def _policy(task: str) -> "Policy":
    from metaworld.policies import ENV_POLICY_MAP  # 50 modules, which most runs start without

    return ENV_POLICY_MAP[f"{task}-v3"]()  # type: ignore[abstract]  # mapped to concrete classes
