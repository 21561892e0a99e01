"""The targets of Meta-World's MT1 benchmark, without building it."""

from collections.abc import Callable
from functools import lru_cache
from typing import Any

import numpy as np
from metaworld.env_dict import ALL_V3_ENVIRONMENTS
from metaworld.sawyer_xyz_env import SawyerXYZEnv

from mtcsirl.names import TARGETS_PER_TASK
from mtcsirl.worlds.fast.models import fresh_simulation


@lru_cache(maxsize=256)
def target_vectors(task: str, seed: int) -> np.ndarray:
    """Return the random vectors [50, n] that fix the targets of ``MT1(task + "-v3", seed).train_tasks``.

    MT1 resets the environment 50 times, simulating 100 steps of the hand each time, and keeps the vector which each
    reset drew last. Which vectors are drawn, and which of them the task rejects, does not depend on the simulation, so
    the same resets run here without it, on the same random stream: 0.05 s instead of 1.2 s. A test compares the two.
    """
    random = np.random.RandomState(seed)  # the generator that Meta-World draws from
    drawn: np.ndarray = np.empty(0)

    def draw(environment: Any) -> np.ndarray:
        nonlocal drawn
        space = environment._random_reset_space
        drawn = random.uniform(space.low, space.high, size=space.low.size)
        return drawn

    environment = _without_simulation(ALL_V3_ENVIRONMENTS[f"{task}-v3"], draw)()
    vectors = []
    for _ in range(TARGETS_PER_TASK):
        environment.reset()
        vectors.append(drawn.copy())
    return np.stack(vectors)


def _without_simulation(task_class: type[SawyerXYZEnv], draw: Callable[[Any], np.ndarray]) -> type[SawyerXYZEnv]:
    """Return a subclass that draws its random vectors with ``draw`` and neither simulates nor observes."""
    methods = {
        "_get_state_rand_vec": draw,
        "do_simulation": lambda self, ctrl, n_frames: None,
        "_get_curr_obs_combined_no_goal": lambda self: np.zeros(18),
        "_get_obs": lambda self: np.zeros(39),
        "_initialize_simulation": fresh_simulation,
    }
    return type(f"{task_class.__name__}WithoutSimulation", (task_class,), methods)
