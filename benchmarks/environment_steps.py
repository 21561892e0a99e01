"""Environment steps per second against stock Meta-World, on every task of the design.

    python benchmarks/environment_steps.py              the table
    python benchmarks/environment_steps.py --identity   first, 10 random episodes a task, compared bit for bit
    python benchmarks/environment_steps.py --profile    then, where the time of a step goes

Ours is the environment that agents train in: float32 and mapped observations, divergence read. Stock is Meta-World's
own class with its target fixed and nothing around it. Both take the same random actions in turns of 100 steps, in one
thread, and what counts is the processor time of that thread: whatever else the machine does slows both alike.
"""

import argparse
import os
from collections.abc import Callable
from importlib.metadata import version
from statistics import median
from time import thread_time
from typing import Any

os.environ.setdefault("OMP_NUM_THREADS", "1")

import numpy as np

from mtcsirl.environments import EPISODE_STEPS, make_environment
from mtcsirl.fast_metaworld.identity import first_difference, stock_environment
from mtcsirl.settings.study import DESIGN_TASKS

TURN_STEPS = 100


def measure(tasks: tuple[str, ...] = DESIGN_TASKS, rounds: int = 7) -> list[dict[str, Any]]:
    """Return rows {benchmark, setting, ours, theirs, peer, ratio}: steps (and resets) a second, medians of rounds.

    A round is one episode. The ratio is the median of the rounds' ratios, not the ratio of the medians.
    """
    peer = f"metaworld {version('metaworld')}"
    rows = []
    for task in tasks:
        ours, theirs = make_environment(task, 0), stock_environment(task, 0)
        _round(ours, theirs, 0)  # warm up
        times = np.array([_round(ours, theirs, seed) for seed in range(1, rounds + 1)])  # [rounds, ours|theirs, kind]
        for kind, (benchmark, count) in enumerate(
            {"environment_steps": EPISODE_STEPS, "environment_resets": 1}.items()
        ):
            ratio = median(times[:, 1, kind] / times[:, 0, kind])
            rates = count / np.median(times[:, :, kind], axis=0)
            rows.append(
                dict(benchmark=benchmark, setting=task, ours=rates[0], theirs=rates[1], peer=peer, ratio=float(ratio))
            )
    return rows


def _round(ours: Any, theirs: Any, seed: int) -> list[tuple[float, float]]:
    """Return the seconds of stepping and of resetting for both environments, over one episode in turns."""
    environments = (ours, theirs)
    actions = np.random.default_rng(seed).uniform(-1, 1, (EPISODE_STEPS, 4)).astype(np.float32)
    resets = [_seconds(environment.reset) for environment in environments]
    steps = [0.0, 0.0]
    for start in range(0, EPISODE_STEPS, TURN_STEPS):
        for i, environment in enumerate(environments):
            steps[i] += _seconds(_play, environment, actions[start : start + TURN_STEPS])
    return list(zip(steps, resets, strict=True))


def _play(environment: Any, actions: np.ndarray) -> None:
    for action in actions:
        environment.step(action)


def _seconds(function: Callable[..., Any], *arguments: Any) -> float:
    start = thread_time()
    function(*arguments)
    return thread_time() - start


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
    seconds = dict.fromkeys(parts, 0.0)
    for part, (owner, method) in parts.items():
        setattr(owner, method, _timed(getattr(owner, method), part, seconds))
    total = 0.0
    for seed in range(episodes):
        environment.reset()
        if seed == 0:
            seconds.update(dict.fromkeys(seconds, 0.0))  # the first reset simulates and observes
        actions = np.random.default_rng(seed).uniform(-1, 1, (EPISODE_STEPS, 4)).astype(np.float32)
        total += _seconds(_play, environment, actions)
    micros = {name: 1e6 * value / (episodes * EPISODE_STEPS) for name, value in ({"step": total} | seconds).items()}
    return micros | {"rest": micros["step"] - sum(micros[part] for part in parts)}


def _timed(function: Callable[..., Any], part: str, seconds: dict[str, float]) -> Callable[..., Any]:
    """Return the function, adding its time to ``seconds[part]``."""

    def timed(*arguments: Any) -> Any:
        start = thread_time()
        result = function(*arguments)
        seconds[part] += thread_time() - start
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
    print(f"{'benchmark':20}{'task':28}{'ours/s':>9}{'stock/s':>9}{'ratio':>8}")
    for row in measure(rounds=arguments.rounds):
        print("{benchmark:20}{setting:28}{ours:9.0f}{theirs:9.0f}{ratio:8.2f}".format(**row))
    if arguments.profile:
        for task in DESIGN_TASKS:
            parts = profile(task)
            print(f"{task:28}" + "  ".join(f"{name} {micros:.0f} us" for name, micros in parts.items()))


if __name__ == "__main__":
    main()
