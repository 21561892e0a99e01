"""Environment steps per second of MT-CSIRL against plain SAC of the same engine, and against imitation's AIRL.

    python -m benchmarks.irl_steps             the table
    python -m benchmarks.irl_steps --profile   then, where the time of an iteration goes

An IRL step is one environment step of one generator with all that training pays for it at the desk scale: action,
replay memory, half a gradient update on relabelled samples, 40 discriminator updates of 256 + 256
transitions per 500 steps, log pi and diagnostics. All take turns of one iteration of 500 steps in one thread, timed in
CPU seconds of that thread.

Plain SAC trains on the task reward of reach-wall with as many updates, by the same engine: a ratio of 0.8 says that an
IRL step costs 1.25 times its step. imitation has AIRL on stable-baselines3's SAC with the same numbers, but for the
gradient penalty, which it lacks. It cannot import Meta-World 3, so there both sides step an environment of random
numbers that costs nothing. Its environment is made by `sh benchmarks/peer_environment.sh imitation`; without it that
row is left out.
"""

import cProfile
import json
import os
import pstats
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path
from time import thread_time
from typing import Any

os.environ.setdefault("OMP_NUM_THREADS", "1")

import numpy as np
import torch

from benchmarks.sides import Row, command, peer, row, seconds, served
from mtcsirl.agents.jobs import AgentJob
from mtcsirl.agents.sac import FusedSac
from mtcsirl.agents.training import Training
from mtcsirl.episodes.demonstrations import collect_demonstrations
from mtcsirl.episodes.lockstep import Outcome
from mtcsirl.files.storage import write_parquet
from mtcsirl.irl.methods import make_method
from mtcsirl.irl.methods.base import Setup
from mtcsirl.irl.rollout import World
from mtcsirl.irl.run import make_trainer
from mtcsirl.irl.trainer import IrlTrainer
from mtcsirl.settings import Settings
from mtcsirl.settings.runs import AgentRunSettings, DemonstrationRunSettings, IrlRunSettings, baseline_run, irl_run
from mtcsirl.transitions import Transitions

TASK, STEPS, EPISODES = "reach-wall", 500, 20


def measure(rounds: int = 5) -> Iterator[Row]:
    """Rows of environment steps a second against plain SAC and, where its environment is made, imitation."""
    turn = _irl_on_meta_world()
    yield _row("mt_csirl, reach-wall", "plain SAC of the same engine", turn, _timed(_plain_sac(rounds)), rounds)
    if peer("imitation").exists():
        with served("imitation", "imitation_airl.py", "serve", _like_ours()) as theirs:
            yield _row("mt_csirl, steps for free", "imitation 1.0.1 AIRL, SB3 2.2.1 SAC", _irl(), theirs, rounds)


def _row(setting: str, against: str, ours: Callable[[], Any], theirs: Callable[[], float], rounds: int) -> Row:
    own = _timed(ours)
    for turn in (own, own, theirs, theirs):  # random steps, first updates, a memory that is not empty
        turn()
    return row("irl_steps", setting, against, [[own(), theirs()] for _ in range(rounds)], STEPS)


def _timed(call: Callable[[], Any]) -> Callable[[], float]:
    return lambda: seconds(call)


def _settings() -> IrlRunSettings:
    """The desk scale's, without warm-up so that every iteration has its discriminator updates."""
    settings = irl_run(Settings(), "single_target", (TASK,))
    return settings.model_copy(update={"irl": settings.irl.model_copy(update={"warm_up_iterations": 0})})


def _irl_on_meta_world() -> Callable[[], None]:
    settings = _settings()
    run = DemonstrationRunSettings(episodes=EPISODES, episode_steps=STEPS)
    policy = FusedSac(1, settings.sac, seeds=[0]).policy(0)
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "demonstrations.parquet"
        write_parquet(file, collect_demonstrations(policy, TASK, 0, run, seed=0, cs_reward="velocity"))
        return make_trainer("mt_csirl", "velocity", [file], 0, settings).iterate


def _plain_sac(rounds: int) -> Callable[[], None]:
    study = Settings(baseline={"steps": {"default": (rounds + 3) * STEPS}}, progress={"select_episodes": 0})
    settings: AgentRunSettings = baseline_run(study, TASK)
    settings = settings.model_copy(update={"sac": settings.sac.model_copy(update={"random_steps": STEPS})})
    return Training([AgentJob(TASK, 0, 0, settings)], log=lambda line: None).episode


class _Noise:
    """One environment whose observations are random numbers."""

    def __init__(self) -> None:
        self._random = np.random.default_rng(0)

    def reset(self) -> np.ndarray:
        return self._random.standard_normal((1, 39), dtype=np.float32)

    def step(self, action: np.ndarray) -> Outcome:
        nothing = np.zeros(1, dtype=bool)
        return Outcome(self.reset(), np.zeros(1, dtype=np.float32), nothing, nothing)

    def close(self) -> None: ...


def _irl() -> Callable[[], None]:
    settings, random = _settings(), torch.Generator().manual_seed(0)
    count = EPISODES * STEPS
    states, following = torch.randn(2, 1, count, 39, generator=random)
    actions = torch.rand(1, count, 4, generator=random) * 1.9 - 0.95
    world = World(
        (("noise", 0),), _Noise(), lambda transitions: transitions.task_reward, lambda *_: {"task_reward": 0.0}
    )
    method = make_method("mt_csirl", Setup(settings.irl, 1, 0))
    return IrlTrainer(
        method, world, Transitions(states, actions, following, torch.zeros(1, count)), settings, 0
    ).iterate


def _like_ours() -> str:
    """Our numbers under the names that imitation_airl.py takes."""
    settings = _settings()
    irl, sac = settings.irl, settings.sac
    return json.dumps(
        {
            "learning_rate": sac.policy_learning_rate,
            "generator_memory": irl.generator_memory,
            "steps_per_iteration": irl.steps_per_iteration,
            "generator_updates": irl.generator_updates,
            "sac_minibatch": sac.minibatch,
            "temperature": Settings().irl.temperature,
            "sac_hidden_sizes": sac.hidden_sizes,
            "hidden_sizes": irl.discriminator.hidden_sizes,
            "minibatch": irl.discriminator.minibatch,
            "discriminator_updates": irl.discriminator_updates,
            "discriminator_learning_rate": irl.discriminator.learning_rate,
            "demonstrations": EPISODES * STEPS,
            "generator_replay": irl.generator_replay,
        }
    )


def profile() -> None:
    """Print the functions of an iteration by the time they spend."""
    iterate = _irl_on_meta_world()
    iterate()
    iterate()
    recorder = cProfile.Profile(thread_time)
    recorder.runcall(iterate)
    pstats.Stats(recorder).sort_stats("cumulative").print_stats("mtcsirl", 30)


if __name__ == "__main__":
    command(__doc__, measure, profile)
