"""Is the fast environment still Meta-World's, bit for bit?"""

from collections.abc import Sequence
from itertools import chain
from typing import Any

import numpy as np
from metaworld import _encode_task
from metaworld.env_dict import ALL_V3_ENVIRONMENTS
from metaworld.policies import ENV_POLICY_MAP
from metaworld.sawyer_xyz_env import SawyerXYZEnv
from metaworld.types import Task

from mtcsirl.worlds.fast.factory import make_fast_environment
from mtcsirl.worlds.fast.targets import target_vectors


def stock_task(task: str, target: int, target_seed: int = 0) -> Task:
    """Return what ``MT1(task + "-v3", target_seed).train_tasks[target]`` is, without building MT1."""
    name = f"{task}-v3"
    vector = target_vectors(task, target_seed)[target]
    return _encode_task(name, dict(rand_vec=vector, env_cls=ALL_V3_ENVIRONMENTS[name], partially_observable=False))


def stock_environment(task: str, target: int, target_seed: int = 0) -> SawyerXYZEnv:
    """Return Meta-World's own environment of the task, with its target fixed."""
    environment = ALL_V3_ENVIRONMENTS[f"{task}-v3"]()
    environment.set_task(stock_task(task, target, target_seed))
    return environment


def first_difference(
    task: str, target: int, *, episodes: int = 10, steps: int = 500, scripted: Sequence[bool] = (False,)
) -> str | None:
    """Run both environments on the same actions; say where they differ first, or return None.

    Compared are the bits of every observation, the reward, both end flags and every entry of info. Actions are uniform
    or, where ``scripted``, those of Meta-World's own policy with noise, which touch and move the objects; the episodes
    cycle through ``scripted``.
    """
    stock, fast = stock_environment(task, target), make_fast_environment(task, target)
    for episode in range(episodes):
        random = np.random.default_rng(episode)
        policy: Any = ENV_POLICY_MAP[f"{task}-v3"]() if scripted[episode % len(scripted)] else None  # type: ignore[abstract]
        observation, _ = stock.reset()
        if observation.tobytes() != fast.reset()[0].tobytes():
            return f"{task}, episode {episode}: the reset differs"
        for step in range(steps):
            action = random.uniform(-1, 1, 4)
            if policy is not None:
                action = np.clip(policy.get_action(observation) + 0.1 * action, -1, 1)
            theirs = stock.step(action.astype(np.float32))
            ours = fast.step(action.astype(np.float32))
            if _bits(theirs) != _bits(ours):
                return f"{task}, episode {episode}, step {step}: {theirs} became {ours}"
            observation = theirs[0]
    return None


def _bits(outcome: tuple[Any, ...]) -> list[tuple[Any, bytes]]:
    """Return every value of an outcome of ``step`` by name, as the bytes of its doubles."""
    values = chain(enumerate(outcome[:4]), outcome[4].items())
    return [(name, np.asarray(value, dtype=np.float64).tobytes()) for name, value in values]
