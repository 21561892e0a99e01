"""SAC gradient updates per second against stock stable-baselines3 and against sbx, at four minibatch sizes.

    python -m benchmarks.sac_updates             the table
    python -m benchmarks.sac_updates --profile   then, where the time of an update goes

Both learners have the networks of the paper (Table 5) and sample their own replay memory of 10,000 transitions, so an
update is what a training run pays for one. They take turns in one thread, timed in CPU seconds of that thread, so that
whatever else the machine does slows both alike. The share of the GEMM peak is the rate at which an update does its
multiplications, over that of one large matrix product timed in the same turns. sbx is stable-baselines3 on JAX; `sh
benchmarks/peer_environment.sh sbx` makes its environment, and without it its rows are left out.
"""

import json
import os
from collections.abc import Callable, Iterator
from importlib.metadata import version
from itertools import pairwise

os.environ.setdefault("OMP_NUM_THREADS", "1")

import gymnasium
import numpy as np
import torch
from stable_baselines3 import SAC
from stable_baselines3.common.logger import Logger

from benchmarks.sides import Row, command, peer, row, seconds, served
from mtcsirl.agents.replay import Replay
from mtcsirl.agents.sac import FusedSac
from mtcsirl.settings import SacSettings

MINIBATCHES = (64, 128, 256, 500)
TRANSITIONS = 10_000
OBSERVATION, ACTION = 39, 4
TURN_SECONDS = 0.25
GEMM = 1024
SBX = "sbx 0.28.0, JAX 0.10.2"


class Spaces(gymnasium.Env[np.ndarray, np.ndarray]):
    """Says what Meta-World looks like."""

    observation_space = gymnasium.spaces.Box(-np.inf, np.inf, (OBSERVATION,), np.float32)
    action_space = gymnasium.spaces.Box(-1.0, 1.0, (ACTION,), np.float32)


def measure(rounds: int = 9, minibatches: tuple[int, ...] = MINIBATCHES) -> Iterator[Row]:
    """Rows of updates a second, one per minibatch and peer; ``gemm_share`` beside stable-baselines3."""
    for minibatch in minibatches:
        yield _against_sb3(minibatch, rounds)
    for minibatch in minibatches if peer("sbx").exists() else ():
        settings = {"minibatch": minibatch, "hidden_sizes": [256, 256], "transitions": TRANSITIONS}
        with served("sbx", "sbx_sac.py", json.dumps(settings)) as theirs:
            yield _against_sbx(minibatch, theirs, rounds)


def _against_sb3(minibatch: int, rounds: int) -> Row:
    turns = (_ours(minibatch), _theirs(minibatch), _gemm())
    counts = [max(1, round(TURN_SECONDS / seconds(turn, 3))) for turn in turns]
    times = np.array([[seconds(*turn) for turn in zip(turns, counts, strict=True)] for _ in range(rounds)])
    rate, peak = update_flops(minibatch) / times[:, 0], 2 * GEMM**3 / times[:, 2]
    found = row(
        "sac_updates", f"minibatch {minibatch}", f"stable-baselines3 {version('stable-baselines3')}", times[:, :2]
    )
    return found | {"gemm_share": float(np.median(rate / peak))}


def _against_sbx(minibatch: int, theirs: Callable[[int], float], rounds: int) -> Row:
    ours = _ours(minibatch)
    theirs(3)  # JAX compiles
    counts = [max(1, round(TURN_SECONDS / once)) for once in (seconds(ours, 3), theirs(3))]
    times = [[seconds(ours, counts[0]), theirs(counts[1])] for _ in range(rounds)]
    return row("sac_updates", f"minibatch {minibatch}", SBX, times)


def update_flops(minibatch: int, hidden: tuple[int, ...] = (256, 256)) -> float:
    """Floating-point operations in the matrix products of one update.

    Forward: actor in s and s', twin target critics, twin critics in the given and in the drawn actions. Backward:
    weights and inputs of critics and actor, and the inputs alone of the critics in the actor's pass; no first layer
    needs its inputs' gradient but the last, and that for the actions only.
    """

    def layers(inputs: int, outputs: int) -> list[int]:
        sizes = (inputs, *hidden, outputs)
        return [fan_in * fan_out for fan_in, fan_out in pairwise(sizes)]

    actor, critic = layers(OBSERVATION, 2 * ACTION), layers(OBSERVATION + ACTION, 1)
    forward = 2 * sum(actor) + 2 * 3 * sum(critic)
    backward = sum(actor) + sum(actor[1:]) + 2 * (sum(critic) + sum(critic[1:]))
    through_critics = 2 * (sum(critic[1:]) + ACTION * hidden[0])
    return 2.0 * minibatch * (forward + backward + through_critics)


def _ours(minibatch: int) -> Callable[[], None]:
    learner, replay = FusedSac(1, SacSettings(), seeds=[0]), Replay([0], TRANSITIONS)
    for observation, action, following, reward in _transitions():
        replay.add(observation[None], action[None], following[None], np.array([reward]))

    def update() -> None:
        batch = replay.sample(minibatch)
        learner.update(batch.observation, batch.action, batch.task_reward, batch.next_observation)

    return update


def _theirs(minibatch: int) -> Callable[[], None]:
    model = SAC(
        "MlpPolicy", Spaces(), buffer_size=TRANSITIONS, policy_kwargs={"net_arch": [256, 256]}, seed=0, device="cpu"
    )
    model.set_logger(Logger(folder=None, output_formats=[]))
    for observation, action, following, reward in _transitions():
        model.replay_buffer.add(observation, following, action, reward, np.zeros(1), [{}])
    return lambda: model.train(1, minibatch)


def _transitions() -> zip:
    random = np.random.default_rng(0)
    observation, following = random.standard_normal((2, TRANSITIONS, OBSERVATION)).astype(np.float32)
    action = random.uniform(-1, 1, (TRANSITIONS, ACTION)).astype(np.float32)
    return zip(observation, action, following, random.uniform(0, 10, TRANSITIONS), strict=True)


def _gemm() -> Callable[[], None]:
    left, right, out = (torch.randn(GEMM, GEMM) for _ in range(3))
    return lambda: torch.mm(left, right, out=out)


def profile(minibatch: int = 128, updates: int = 100) -> None:
    """Print the operators of our update by the time they spend themselves."""
    update = _ours(minibatch)
    update()
    with torch.profiler.profile(record_shapes=True) as record:
        for _ in range(updates):
            update()
    events = record.key_averages(group_by_input_shape=True)
    print(events.table(sort_by="self_cpu_time_total", row_limit=15, max_shapes_column_width=60))


if __name__ == "__main__":
    command(__doc__, measure, profile)
