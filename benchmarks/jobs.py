"""What a training job costs before it trains and how much memory it holds, against a script of stable-baselines3.

    python -m benchmarks.jobs

start_up: seconds of CPU from the start of the process to the end of a job of two environment steps, `mtcsirl train-sac`
with its evaluation of one step, and `SAC(...).learn(2)` on stock Meta-World. memory: MiB that each holds at most in a
job of 2,000 steps with the desk scale's networks, minibatch and length of the replay memory. Smaller is better, so the
ratio is theirs over ours.
"""

import json
import os
import resource
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from importlib.metadata import version
from pathlib import Path

from benchmarks.sides import Row, command, row
from mtcsirl.files.storage import write_json
from mtcsirl.settings import Settings
from mtcsirl.settings.runs import AgentRunSettings, baseline_run

TASK = "reach-wall"
START_STEPS, MEMORY_STEPS = 2, 2_000

_PEER = """
import json, sys
import torch
from stable_baselines3 import SAC
from mtcsirl.worlds.fast.identity import stock_environment

torch.set_num_threads(1)
steps, keywords = json.loads(sys.argv[1])
SAC("MlpPolicy", stock_environment("reach-wall", 0), **keywords).learn(steps)
"""
_OURS = "import sys; from mtcsirl.cli import main; main(sys.argv[1:])"
_PEAK = """
print(next(line.split()[1] for line in open("/proc/self/status") if line.startswith("VmHWM")))
"""
"""Prints a process's own peak in KiB: what the kernel reports to its parent would begin with the parent's."""


def measure(rounds: int = 5) -> Iterator[Row]:
    """Rows of start_up [s] and memory [MiB]: costs, unlike the other benchmarks' rates."""
    peer = f"stable-baselines3 {version('stable-baselines3')} on metaworld {version('metaworld')}"
    for benchmark, steps, index in (("start_up", START_STEPS, 0), ("memory", MEMORY_STEPS, 1)):
        turns = [[side(steps)[index] for side in (_ours, _theirs)] for _ in range(rounds)]
        found = row(benchmark, f"{TASK}, {steps} steps", peer, turns)
        yield found | {"ours": 1 / found["ours"], "theirs": 1 / found["theirs"]}


def _settings() -> AgentRunSettings:
    return baseline_run(Settings(), TASK)


def _ours(steps: int) -> tuple[float, float]:
    settings = _settings().model_dump(mode="json")
    settings |= {"steps": steps, "evaluation": {"episodes": 1, "episode_steps": min(steps, 500)}}
    settings["progress"]["select_episodes"] = 0
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "run.json"
        write_json(file, settings)
        words = ["train-sac", "--task", TASK, "--target", "0", "--seed", "0", "--settings", str(file)]
        return _cost(_OURS, [*words, "--output", f"{folder}/run"])


def _theirs(steps: int) -> tuple[float, float]:
    settings = _settings()
    keywords = {
        "buffer_size": settings.steps,
        "learning_starts": settings.sac.random_steps,
        "batch_size": settings.sac.minibatch,
        "train_freq": 2,
        "policy_kwargs": {"net_arch": list(settings.sac.hidden_sizes)},
        "device": "cpu",
    }
    return _cost(_PEER, [json.dumps([steps, keywords])])


def _cost(program: str, words: list[str]) -> tuple[float, float]:
    """CPU seconds and most MiB of a Python process."""
    command = [sys.executable, "-c", f"{program}\n{_PEAK}", *words]
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    done = subprocess.run(command, env=os.environ | {"OMP_NUM_THREADS": "1"}, capture_output=True, text=True)
    if done.returncode:
        raise RuntimeError(f"{words[0]}: {done.stderr.strip().splitlines()[-1]}")
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    seconds = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    return seconds, int(done.stdout.split()[-1]) / 1024


if __name__ == "__main__":
    command(__doc__, measure, None)
