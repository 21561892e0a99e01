"""Where the time of an IRL iteration goes, for 1, 3, 6 and 30 generators.

    python -m benchmarks.irl_parts                      five CPU minutes
    python -m benchmarks.irl_parts --generators 6       one row

An iteration of MT-CSIRL at the desk scale, past its warm-up, all memories of the discriminator full: Meta-World's
environments, random numbers for demonstrations and for what the generators did before. CPU seconds of one thread; of
several iterations the one in which SAC's updates were fastest. `peak` is the rate of one 1024 x 1024 product of torch,
timed before and after; `floor` what the products of SAC's updates alone take at that rate.
"""

import argparse
import os
from collections import defaultdict
from collections.abc import Callable
from time import thread_time
from typing import Any

os.environ.setdefault("OMP_NUM_THREADS", "1")

import numpy as np
import torch

from benchmarks.sac_updates import GEMM, update_flops
from benchmarks.sides import seconds
from mtcsirl.episodes.lockstep import make_environments
from mtcsirl.irl.methods import make_method
from mtcsirl.irl.methods.base import Setup
from mtcsirl.irl.rollout import World
from mtcsirl.irl.trainer import IrlTrainer
from mtcsirl.settings import Settings
from mtcsirl.settings.runs import IrlRunSettings, irl_run
from mtcsirl.transitions import Transitions

TASKS = ("reach-wall", "push-back", "window-open", "drawer-close", "coffee-button", "plate-slide")
DEMONSTRATIONS = 10_000
PARTS = ("SAC", "environment", "acting", "discriminators", "log pi", "sampling and relabelling", "rest")


def settings() -> IrlRunSettings:
    """The desk scale's, of several tasks, without warm-up and random actions."""
    found = irl_run(Settings(), "multi_task", TASKS)
    irl = found.irl.model_copy(update={"warm_up_iterations": 0})
    return found.model_copy(update={"irl": irl, "sac": found.sac.model_copy(update={"random_steps": 0})})


def make_trainer(generators: int) -> IrlTrainer:
    """A trainer in the middle of its run."""
    own, random = settings(), torch.Generator().manual_seed(0)
    members = tuple((TASKS[index % len(TASKS)], 1 + index // len(TASKS)) for index in range(generators))
    states, following = torch.randn(2, generators, DEMONSTRATIONS, 39, generator=random)
    actions = torch.rand(generators, DEMONSTRATIONS, 4, generator=random) * 1.9 - 0.95
    demonstrations = Transitions(states, actions, following, torch.ones(generators, DEMONSTRATIONS))
    environments = make_environments(members, own.environment, 0)
    world = World(members, environments, lambda found: found.task_reward, lambda *_: {"task_reward": 0.0})
    trainer = IrlTrainer(make_method("mt_csirl", Setup(own.irl, generators, 0)), world, demonstrations, own, 0)
    for step in range(own.irl.generator_replay * own.irl.steps_per_iteration):
        rows = (part[:, step % DEMONSTRATIONS].numpy() for part in (states, actions, following))
        trainer.replay.add(*rows, np.ones(generators, dtype=np.float32))
    trainer.start_at(own.irl.generator_replay)
    for _ in range(trainer.densities._policies - 1):
        trainer._tabulate(False)
    return trainer


def timed(trainer: IrlTrainer) -> dict[str, float]:
    """Seconds that the calls of each part take from now on, filled as they are made."""
    spent: dict[str, float] = defaultdict(float)

    def watch(holder: Any, name: str, part: str) -> None:
        inner: Callable[..., Any] = getattr(holder, name)

        def call(*arguments: Any) -> Any:
            started = thread_time()
            try:
                return inner(*arguments)
            finally:
                spent[part] += thread_time() - started

        setattr(holder, name, call)

    watch(trainer.sac, "update", "SAC")
    watch(trainer.world.environments, "step", "environment")
    watch(trainer.world.environments, "reset", "environment")
    watch(trainer, "_act", "acting")
    watch(trainer, "_on_step", "acting")
    watch(trainer, "_update_discriminators", "discriminators")
    watch(trainer, "_tabulate", "log pi")
    watch(trainer.replay, "sample", "sampling and relabelling")
    watch(trainer, "policy_reward", "sampling and relabelling")
    return spent


def iteration(generators: int, rounds: int) -> dict[str, float]:
    """Seconds of one iteration by part, the whole as ``all``."""
    trainer = make_trainer(generators)
    spent, found = timed(trainer), []
    for _ in range(rounds + 1):
        spent.clear()
        whole = seconds(trainer.iterate)
        found.append(dict(spent) | {"rest": whole - sum(spent.values()), "all": whole})
    trainer.world.environments.close()
    return min(found[1:], key=lambda parts: parts["SAC"])


def peak(tries: int = 5) -> float:
    """Operations a second of one large product."""
    left, right, out = (torch.randn(GEMM, GEMM) for _ in range(3))
    return 2.0 * GEMM**3 / min(seconds(lambda: torch.mm(left, right, out=out), 5) for _ in range(tries))


def main() -> None:
    """Print a row of Markdown's table for each number of generators."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--generators", type=int, nargs="+", default=(1, 3, 6, 30))
    parser.add_argument("--rounds", type=int, default=3, help="iterations of each (default 3)")
    arguments = parser.parse_args()
    torch.set_num_threads(1)
    own = settings()
    print("| generators | seconds |", *(f"{part} |" for part in PARTS), "peak, GF/s | floor | SAC / floor |")
    print("|---:" * (len(PARTS) + 5) + "|")
    for generators in arguments.generators:
        before = peak()
        parts = iteration(generators, arguments.rounds)
        rate = max(before, peak())
        floor = generators * own.irl.generator_updates * update_flops(own.sac.minibatch, own.sac.hidden_sizes) / rate
        cells = [str(generators), f"{parts['all']:.2f}", *(f"{parts[part] / parts['all']:.1%}" for part in PARTS)]
        print("|", " | ".join([*cells, f"{rate / 1e9:.0f}", f"{floor:.2f}", f"{parts['SAC'] / floor:.2f}"]), "|")


if __name__ == "__main__":
    main()
