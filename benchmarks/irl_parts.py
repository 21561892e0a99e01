"""Where the time of an IRL iteration goes, for 1, 3, 6 and 30 generators.

    python -m benchmarks.irl_parts                      five CPU minutes
    python -m benchmarks.irl_parts --generators 6       one row

An iteration of MT-CSIRL at the desk scale, in the middle of its run (:mod:`mtcsirl.calibration.loops`). CPU
seconds of one thread; of several iterations the one in which SAC's updates were fastest. `peak` is the rate of one
1024 x 1024 product of torch, timed before and after; `floor` what the products of SAC's updates alone take at that
rate.
"""

import argparse
import os

os.environ.setdefault("OMP_NUM_THREADS", "1")

import torch

from benchmarks.sac_updates import GEMM, update_flops
from benchmarks.sides import seconds
from mtcsirl.calibration import loops
from mtcsirl.settings import Settings
from mtcsirl.settings.runs import IrlRunSettings, irl_run

TASKS = ("reach-wall", "push-back", "window-open", "drawer-close", "coffee-button", "plate-slide")
PARTS = ("SAC", "environment", "acting", "discriminators", "log pi", loops.REPLAY, "rest")


def settings() -> IrlRunSettings:
    """The desk scale's, of several tasks."""
    return irl_run(Settings(), "multi_task", TASKS)


def iteration(generators: int, rounds: int) -> dict[str, float]:
    """Seconds of one iteration by part, the whole as ``all``."""
    trainer = loops.generators(loops.members_of(TASKS, generators), "mt_csirl", settings())
    spent, found = loops.watch_generators(trainer), []
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
