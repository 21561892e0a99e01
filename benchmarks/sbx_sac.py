"""SAC of sbx (stable-baselines3 on JAX), for benchmarks/sac_updates.py.

Runs in the environment that `sh benchmarks/peer_environment.sh sbx` makes and imports nothing of this suite:

    build/sbx/bin/python benchmarks/sbx_sac.py SETTINGS   so many updates per line of standard input

JAX starts threads of its own whatever it is told, so this counts the CPU seconds of the process.
"""

import json
import os
import sys
from time import process_time
from typing import Any

os.environ["XLA_FLAGS"] = "--xla_cpu_multi_thread_eigen=false"
os.environ["JAX_PLATFORMS"] = "cpu"

import gymnasium
import numpy as np
from sbx import SAC
from stable_baselines3.common.logger import Logger

OBSERVATION, ACTION = 39, 4


class Spaces(gymnasium.Env):
    """Says what Meta-World looks like."""

    observation_space = gymnasium.spaces.Box(-np.inf, np.inf, (OBSERVATION,), np.float32)
    action_space = gymnasium.spaces.Box(-1.0, 1.0, (ACTION,), np.float32)


def learner(settings: dict[str, Any]) -> SAC:
    """SAC with a memory of random transitions."""
    count, sizes = settings["transitions"], settings["hidden_sizes"]
    model = SAC("MlpPolicy", Spaces(), buffer_size=count, policy_kwargs={"net_arch": sizes}, seed=0)
    model.set_logger(Logger(folder=None, output_formats=[]))
    random = np.random.default_rng(0)
    for _ in range(count):
        observation, following = random.standard_normal((2, 1, OBSERVATION)).astype(np.float32)
        action = random.uniform(-1, 1, (1, ACTION)).astype(np.float32)
        model.replay_buffer.add(observation, following, action, random.uniform(0, 10, 1), np.zeros(1), [{}])
    return model


def serve(settings: dict[str, Any]) -> None:
    """Answer each number that comes in with the CPU seconds of one update, the mean of so many, one call each."""
    model = learner(settings)
    for line in sys.stdin:
        count, started = int(line), process_time()
        for _ in range(count):
            model.train(1, settings["minibatch"])
        print((process_time() - started) / count, flush=True)


if __name__ == "__main__":
    serve(json.loads(sys.argv[1]))
