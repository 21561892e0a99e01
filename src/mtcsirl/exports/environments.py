"""The fast Meta-World as gymnasium environments for other people's agents; importing this module registers them.

    import gymnasium
    import mtcsirl.exports.environments
    gymnasium.make("mtcsirl/reach-wall-v0", target=3, cs_reward="velocity", observation="mapped")

Since 1.0 gymnasium looks for no entry points of packages, so the import cannot be left out; the id
``mtcsirl.exports.environments:mtcsirl/reach-wall-v0`` contains it.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import torch

from mtcsirl.errors import UserError
from mtcsirl.names import TASKS
from mtcsirl.rewards.adapter import ground_truth
from mtcsirl.rewards.ground_truth import COMMON_SENSE_REWARDS
from mtcsirl.rewards.learned import check_learned, load_learned_reward
from mtcsirl.settings import Settings
from mtcsirl.settings.runs import expert_run
from mtcsirl.transitions import RewardFunction, Transitions
from mtcsirl.worlds.environments import TaskEnvironment, make_environment

NAMESPACE = "mtcsirl"


class AddedReward(gymnasium.Wrapper[np.ndarray, np.ndarray, np.ndarray, np.ndarray]):
    """An environment that pays ``task_weight r_task + weight f(s, a, s')``; info has both parts without weights.

    There is no curriculum: the weights stay what they are.
    """

    def __init__(
        self, env: gymnasium.Env[Any, Any], f: RewardFunction, *, weight: float = 1.0, task_weight: float = 1.0
    ) -> None:
        """``f``: of transitions [1, ...] as the agent sees them."""
        super().__init__(env)
        self._f, self._weight, self._task_weight = f, weight, task_weight
        self._observation: np.ndarray | None = None

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[np.ndarray, dict[str, Any]]:
        """Return the first observation [39] and what the environment says of it."""
        self._observation, info = self.env.reset(seed=seed, options=options)
        return self._observation, info

    def step(self, action: np.ndarray) -> tuple[np.ndarray, float, bool, bool, dict[str, Any]]:
        """Apply an action [4]; info says ``task_reward`` and ``f``."""
        if self._observation is None:
            raise UserError("call reset() before step()")
        after, paid, terminated, truncated, info = self.env.step(action)
        parts = (self._observation, np.asarray(action, dtype=np.float32), after, np.float32(paid))
        with torch.no_grad():
            f = float(self._f(Transitions(*(torch.as_tensor(part)[None] for part in parts))))
        self._observation = after
        reward = self._task_weight * float(paid) + self._weight * f
        return after, reward, terminated, truncated, info | {"task_reward": float(paid), "f": f}


def make(
    task: str,
    target: int = 0,
    *,
    cs_reward: str | None = None,
    cs_weight: float | None = None,
    observation: str = "mapped",
    target_seed: int = 0,
    render_mode: str | None = None,
) -> gymnasium.Env[np.ndarray, np.ndarray]:
    """The fast environment of a task; with a ``cs_reward`` it pays r_task + cs_weight r_cs, the ground truth.

    ``cs_weight``: default is an expert's of this task. ``observation``: "mapped" or "raw". ``render_mode``: None or
    "rgb_array".

    Raises:
        UserError: an argument names nothing that there is; rendering without OSMesa.
    """
    if cs_reward is not None and cs_reward not in COMMON_SENSE_REWARDS:
        raise UserError(f"cs_reward: unknown {cs_reward!r}; choose {' or '.join(COMMON_SENSE_REWARDS)}")
    if render_mode not in (None, "rgb_array"):
        raise UserError(f"render_mode: {render_mode!r} cannot be; choose rgb_array")
    render = render_mode is not None
    env = make_environment(task, target, observation=observation, target_seed=target_seed, render=render)
    if cs_reward is None:
        return env
    weight = expert_run(Settings(), task, cs_reward).cs_weight if cs_weight is None else cs_weight
    return AddedReward(env, ground_truth(cs_reward, observation), weight=weight)


def with_learned_reward(
    env: gymnasium.Env[Any, Any], folder: Path | str, *, weight: float = 1.0, alone: bool = False
) -> AddedReward:
    """``env`` with the learned reward in ``folder`` added to the task's, or ``alone``.

    Raises:
        UserError: the reward was learned on other observations, or its files are damaged; ``env`` is none of this
            module's.
    """
    inner = env.unwrapped
    if not isinstance(inner, TaskEnvironment):
        raise UserError(f"{folder}: reads the observations of mtcsirl's environments, not of {type(inner).__name__}")
    learned = load_learned_reward(folder)
    check_learned(learned, folder, observation=inner.observation_map.name)
    return AddedReward(env, learned, weight=weight, task_weight=0.0 if alone else 1.0)


def register() -> None:
    """Register ``mtcsirl/TASK-v0`` for each of Meta-World's tasks, once."""
    for task in TASKS:
        name = f"{NAMESPACE}/{task}-v0"
        if name not in gymnasium.registry:
            gymnasium.register(name, entry_point=f"{__name__}:make", kwargs={"task": task}, nondeterministic=False)


register()
