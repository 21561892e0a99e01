"""Environment steps per second against stock Meta-World, on every task of the design.

    python -m benchmarks.environment_steps              the table
    python -m benchmarks.environment_steps --identity   first, 10 random episodes a task, compared bit for bit
    python -m benchmarks.environment_steps --profile    then, where the time of a step goes

Ours is the environment that agents train in: float32 and mapped observations, divergence read. Stock is Meta-World's
own class with its target fixed and nothing around it. Both take the same random actions in turns of 100 steps, in one
thread, and what counts is the processor time of that thread: whatever else the machine does slows both alike.
"""

import argparse
import os
from collections.abc import Callable, Iterator
from functools import partial
from importlib.metadata import version
from time import thread_time
from typing import Any

os.environ.setdefault("OMP_NUM_THREADS", "1")

import numpy as np

from benchmarks.sides import Row, print_rows, row, seconds
from mtcsirl.names import DESIGN_TASKS
from mtcsirl.worlds.environments import EPISODE_STEPS, make_environment
from mtcsirl.worlds.fast.identity import first_difference, stock_environment

TURN_STEPS = 100


def measure(rounds: int = 7, tasks: tuple[str, ...] = DESIGN_TASKS) -> Iterator[Row]:
    """Rows of steps and of resets a second, two per task; a round is one episode."""
    peer = f"metaworld {version('metaworld')}"
    for task in tasks:
        ours, theirs = make_environment(task, 0), stock_environment(task, 0)
        _round(ours, theirs, 0)  # warm up
        times = np.array([_round(ours, theirs, seed) for seed in range(1, rounds + 1)])  # [rounds, ours|theirs, kind]
        yield row("environment_steps", task, peer, times[:, :, 0], EPISODE_STEPS)
        yield row("environment_resets", task, peer, times[:, :, 1])


def _round(ours: Any, theirs: Any, seed: int) -> list[tuple[float, float]]:
    """Return the seconds of stepping and of resetting for both environments, over one episode in turns."""
    environments = (ours, theirs)
    actions = np.random.default_rng(seed).uniform(-1, 1, (EPISODE_STEPS, 4)).astype(np.float32)
    resets = [seconds(environment.reset) for environment in environments]
    steps = [0.0, 0.0]
    for start in range(0, EPISODE_STEPS, TURN_STEPS):
        for i, environment in enumerate(environments):
            steps[i] += seconds(partial(_play, environment, actions[start : start + TURN_STEPS]))
    return list(zip(steps, resets, strict=True))


def _play(environment: Any, actions: np.ndarray) -> None:
    for action in actions:
        environment.step(action)


def profile(task: str, episodes: int = 5) -> dict[str, float]:
    """Return microseconds of one step and of its parts: action, simulation, observation, reward, map, the rest."""
    environment = make_environment(task, 0)
    simulator = environment.simulator
    parts = {
        "action": (simulator, "set_xyz_action"),
        "simulation": (simulator, "_simulate"),
        "observation": (simulator, "_get_obs"),
        "reward": (simulator, "evaluate_state"),
        "map": (environment, "_seen"),
    }
    spent = dict.fromkeys(parts, 0.0)
    for part, (owner, method) in parts.items():
        setattr(owner, method, _timed(getattr(owner, method), part, spent))
    total = 0.0
    for seed in range(episodes):
        environment.reset()
        if seed == 0:
            spent.update(dict.fromkeys(spent, 0.0))  # the first reset simulates and observes
        actions = np.random.default_rng(seed).uniform(-1, 1, (EPISODE_STEPS, 4)).astype(np.float32)
        total += seconds(partial(_play, environment, actions))
    micros = {name: 1e6 * value / (episodes * EPISODE_STEPS) for name, value in ({"step": total} | spent).items()}
    return micros | {"rest": micros["step"] - sum(micros[part] for part in parts)}


def _timed(function: Callable[..., Any], part: str, spent: dict[str, float]) -> Callable[..., Any]:
    """Return the function, adding its time to ``spent[part]``."""

    def timed(*arguments: Any) -> Any:
        start = thread_time()
        result = function(*arguments)
        spent[part] += thread_time() - start
        return result

    return timed


def main() -> None:
    """Print the measurements."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--identity", action="store_true")
    parser.add_argument("--profile", action="store_true")
    parser.add_argument("--rounds", type=int, default=7)
    arguments = parser.parse_args()
    if arguments.identity:
        for task in DESIGN_TASKS:
            difference = first_difference(task, 0, episodes=10)
            print(f"{task:28}{difference or '10 random episodes identical'}", flush=True)
    print_rows(measure(arguments.rounds))
    if arguments.profile:
        for task in DESIGN_TASKS:
            parts = profile(task)
            print(f"{task:28}" + "  ".join(f"{name} {micros:.0f} us" for name, micros in parts.items()))


if __name__ == "__main__":
    main()
