"""From a task and a target to its fast environment."""

from functools import cache

from metaworld.env_dict import ALL_V3_ENVIRONMENTS

from mtcsirl.worlds.fast.borrowed import with_faster_helpers
from mtcsirl.worlds.fast.environment import FastEnvironment
from mtcsirl.worlds.fast.targets import target_vectors


def make_fast_environment(task: str, target: int, target_seed: int = 0) -> FastEnvironment:
    """Return the environment that ``MT1(task + "-v3", target_seed)`` with ``train_tasks[target]`` describes."""
    vector = target_vectors(task, target_seed)[target]
    environment = fast_class(task)()
    environment.fix_target(vector)
    return environment


@cache
def fast_class(task: str) -> type[FastEnvironment]:
    """Return Meta-World's class of the task with ``FastEnvironment`` laid over it."""
    task_class = with_faster_helpers(ALL_V3_ENVIRONMENTS[f"{task}-v3"])
    return type(f"Fast{task_class.__name__}", (FastEnvironment, task_class), {})
