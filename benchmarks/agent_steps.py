"""Agent steps per second, end to end, against stock stable-baselines3 on stock Meta-World.

    python benchmarks/agent_steps.py             the table
    python benchmarks/agent_steps.py --profile   then, where the time of our steps goes

An agent step is one environment step with all that training pays for it: the policy's action, the replay memory, half a
gradient update (the desk scale) and, on our side only, relabelling with the expert's velocity reward
and the metrics of the learning curve. Both take turns of one episode in one thread, timed in CPU seconds of that
thread.
"""

import argparse
import cProfile
import os
import pstats
from collections.abc import Callable
from importlib.metadata import version
from statistics import median, quantiles
from time import thread_time
from typing import Any

os.environ.setdefault("OMP_NUM_THREADS", "1")

import numpy as np
import torch
from stable_baselines3 import SAC

from mtcsirl.agents.jobs import AgentJob
from mtcsirl.agents.relabelling import ground_truth
from mtcsirl.agents.training import Training
from mtcsirl.fast_metaworld.identity import stock_environment
from mtcsirl.settings.runs import AgentRunSettings

TASKS = ("reach-wall", "push-back")
EPISODE_STEPS = 500
RANDOM_STEPS = 500


def measure(tasks: tuple[str, ...] = TASKS, rounds: int = 5) -> list[dict[str, Any]]:
    """Return rows {benchmark, setting, ours, theirs, peer, ratio, ...}: steps a second, medians of rounds.

    The ratio is the median of the rounds' ratios; ratio_low and ratio_high are its quartiles over rounds.
    """
    torch.set_num_threads(1)
    peer = f"stable-baselines3 {version('stable-baselines3')} on metaworld {version('metaworld')}"
    rows = []
    for task in tasks:
        settings = _settings(rounds)
        ours, theirs = _ours(task, settings), _theirs(task, settings)
        for episode in (ours, theirs):  # the random steps, without updates
            episode()
        times = np.array([[_seconds(ours), _seconds(theirs)] for _ in range(rounds)])
        ratios = list(times[:, 1] / times[:, 0])
        low, _, high = quantiles(ratios, n=4)
        rates = EPISODE_STEPS / np.median(times, axis=0)
        rows.append(
            {
                "benchmark": "agent_steps",
                "setting": f"{task}, minibatch {settings.sac.minibatch}, an update every 2 steps",
                "ours": float(rates[0]),
                "theirs": float(rates[1]),
                "peer": peer,
                "ratio": median(ratios),
                "ratio_low": low,
                "ratio_high": high,
            }
        )
    return rows


def _settings(rounds: int) -> AgentRunSettings:
    return AgentRunSettings(
        steps=(rounds + 1) * EPISODE_STEPS,
        cs_weight=1.0,
        curriculum=True,
        sac={"random_steps": RANDOM_STEPS},
    )


def _ours(task: str, settings: AgentRunSettings) -> Callable[[], None]:
    f = ground_truth("velocity", settings.environment.observation)
    job = AgentJob(task, 0, 0, settings, "velocity", f, gate="expert")
    return Training([job], log=lambda line: None).episode


def _theirs(task: str, settings: AgentRunSettings) -> Callable[[], None]:
    model = SAC(
        "MlpPolicy",
        stock_environment(task, 0),
        learning_rate=settings.sac.critic_learning_rate,
        buffer_size=settings.steps,
        learning_starts=RANDOM_STEPS,
        batch_size=settings.sac.minibatch,
        train_freq=2,
        gradient_steps=1,
        policy_kwargs={"net_arch": list(settings.sac.hidden_sizes)},
        seed=0,
        device="cpu",
    )

    def episode() -> None:
        model.learn(EPISODE_STEPS, reset_num_timesteps=False)

    return episode


def _seconds(call: Callable[[], None]) -> float:
    """CPU seconds of this thread."""
    started = thread_time()
    call()
    return thread_time() - started


def profile(task: str) -> None:
    """Print the functions of our loop by the time they spend."""
    episode = _ours(task, _settings(2))
    episode()
    recorder = cProfile.Profile(thread_time)
    recorder.runcall(episode)
    pstats.Stats(recorder).sort_stats("cumulative").print_stats("mtcsirl", 25)


def main() -> None:
    """Print the table, on request the profile."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--rounds", type=int, default=5, help="episodes of each (default 5)")
    parser.add_argument("--profile", action="store_true", help="show where the time of a step goes")
    arguments = parser.parse_args()
    print(f"{'task':<28}{'ours':>8}{'theirs':>8}{'ratio':>7}{'quartiles':>13}")
    for task in TASKS:
        (row,) = measure((task,), arguments.rounds)
        print(
            f"{task:<28}{row['ours']:>8.1f}{row['theirs']:>8.1f}{row['ratio']:>7.2f}"
            f"{row['ratio_low']:>8.2f}-{row['ratio_high']:.2f}",
            flush=True,
        )
    if arguments.profile:
        profile(TASKS[0])


if __name__ == "__main__":
    main()
