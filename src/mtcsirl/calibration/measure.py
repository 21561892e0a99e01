"""Measures the rates of this machine (:mod:`mtcsirl.study.rates`). One thread, more than seven minutes.

The loops are those that train, with memories as full as theirs, so that what a plan adds up has been timed where it
happens. CPU seconds, so that what else the machine does shifts them little; it should do little all the same. All is
measured in several passes: a machine that others share is slow for seconds at a time.
"""

import resource
import subprocess
import sys
import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from statistics import mean, median
from typing import Any

import numpy as np
import torch

from mtcsirl.agents.scripted import ScriptedExplorers
from mtcsirl.calibration import loops
from mtcsirl.calibration.scores import score_seconds
from mtcsirl.episodes.demonstrations import collect_demonstrations
from mtcsirl.episodes.evaluation import run_episode
from mtcsirl.episodes.policy import Policy
from mtcsirl.files.provenance import machine
from mtcsirl.files.storage import write_parquet
from mtcsirl.irl.trainer import IrlTrainer
from mtcsirl.names import METHODS, SINGLE_TASKS, TRAIN_TASKS
from mtcsirl.settings import EnvironmentSettings, SacSettings, Settings
from mtcsirl.settings.loading import validate
from mtcsirl.settings.runs import DemonstrationRunSettings, IrlRunSettings, irl_run
from mtcsirl.study.rates import DEFAULT, Rates
from mtcsirl.worlds.environments import ACTION_SIZE, make_environment

TASKS = tuple(dict.fromkeys((*SINGLE_TASKS, *TRAIN_TASKS)))
USUAL, USUAL_METHOD = TASKS[0], "mt_csirl"
MINIBATCHES = (64, 128, 256, 500)
EPISODE = 500
AGENTS, GENERATORS = (1, 16), (1, 6)
"""How many step together: a lone one, and a batch of ``train-together`` or the generators of the desk scale."""
UPDATES = 40
NOISE = 0.3
"""On the hand-written policy's actions."""
LEAST = 1e-7
"""Seconds, where a difference of two measurements is lost in their noise."""
PASSES = 3
TURNS = 5
"""Episodes of learners: so many that those that start together run together."""
START = (
    "from mtcsirl.stages import train_sac; from mtcsirl.worlds.environments import make_environment;"
    " make_environment('reach', 0)"
)
"""What a job does before it trains: imports its stage, makes its environment."""
FRAMES = f"{START}; import pandas, pyarrow.parquet"
ALONE = "from mtcsirl.calibration.measure import lone_step; import torch; torch.set_num_threads(1); print(lone_step())"


def calibrate() -> Rates:
    """All rates of this machine.

    Raises:
        UserError: one of them cannot be, such as 0 seconds.
    """
    torch.set_num_threads(1)
    found = machine()
    who = {"machine": f"{found['processor']}, {found['cores']} cores"}
    return validate(Rates, who | _medians([_measured() for _ in range(PASSES)]))


def _measured() -> dict[str, Any]:
    """Every rate once."""
    started = _spent(START)
    environment_step = {task: environment_seconds(task) for task in TASKS}
    return {
        "start_up": started,
        "frames": max(_spent(FRAMES) - started, LEAST),
        "environment_step": {DEFAULT: median(environment_step.values()), **environment_step},
        **episode_seconds(),
        "agents": {count: agent_seconds(count) for count in AGENTS},
        "generators": {count: generator_seconds(count) for count in GENERATORS},
        **score_seconds(),
        "slowdown": slowdown(2),
    }


def _medians(passes: Sequence[Any]) -> Any:
    """Of every rate the median over passes, to three digits: more say nothing."""
    if isinstance(passes[0], Mapping):
        return {name: _medians([one[name] for one in passes]) for name in passes[0]}
    return float(f"{median(passes):.3g}")


def environment_seconds(task: str, episodes: int = 2) -> float:
    """Per step of ``task`` as Meta-World's hand-written policy acts: contacts cost, and random actions make few."""
    environment, steps = make_environment(task, 0), episodes * EPISODE
    spent = loops.watch(environment, "step", "reset")
    explorers = ScriptedExplorers([task], [0], [steps], [NOISE], EnvironmentSettings().observation)
    action = np.zeros((1, ACTION_SIZE), dtype=np.float32)
    for step in range(steps):
        if step % EPISODE == 0:
            observation, _ = environment.reset()
        explorers.replace(action, observation[None], step)
        observation, *_ = environment.step(action[0])
    environment.close()
    return sum(spent.values()) / steps


def episode_seconds() -> dict[str, float]:
    """Per step beside the simulation's: of a policy that is tried, and what recording and writing it adds."""
    training = loops.agents([(USUAL, 0)], SacSettings(), EPISODE)
    policy = training.policy(0)
    training.close()
    environment, random = make_environment(USUAL, 0), np.random.default_rng(0)
    spent = loops.watch(environment, "step", "reset")
    whole = loops.seconds(lambda: [run_episode(policy, environment, EPISODE, random) for _ in range(TURNS)])
    simulated = sum(spent.values()) / (TURNS * EPISODE)
    tried = whole / (TURNS * EPISODE) - simulated
    _record(policy, 1)  # imports
    recorded = loops.seconds(lambda: _record(policy, 10)) / (10 * EPISODE)
    return {"episode_step": tried, "recorded": max(recorded - tried - simulated, LEAST)}


def _record(policy: Policy, episodes: int) -> None:
    frame = collect_demonstrations(policy, USUAL, 0, DemonstrationRunSettings(episodes=episodes), seed=0)
    with tempfile.TemporaryDirectory() as folder:
        write_parquet(Path(folder) / "demonstrations.parquet", frame)


def agent_seconds(count: int, minibatches: tuple[int, ...] = MINIBATCHES) -> dict[str, Any]:
    """One agent's share among ``count``, by the fields of ``AgentRates``."""
    steps, update = [], {}
    for minibatch in minibatches:
        sac = SacSettings(minibatch=minibatch)
        length = int(UPDATES / sac.updates_per_step)
        training = loops.agents(loops.members_of(TASKS, count), sac, length)
        spent = loops.watch_agents(training)
        training.episode()
        spent.clear()
        done = training.learner.updates
        whole = loops.seconds(training.episode)
        update[minibatch] = spent["updates"] / count / (training.learner.updates - done)
        steps.append((whole - sum(spent.values())) / count / length)
        training.close()
    return {"step": median(steps), "update": update}


def generator_seconds(count: int) -> dict[str, Any]:
    """One generator's share among ``count``, by the fields of ``GeneratorRates``."""
    trainer = loops.generators(loops.members_of(TASKS, count), USUAL_METHOD, irl_run(Settings(), "multi_task", TASKS))
    spent = loops.watch_generators(trainer)
    update, steps, densities = {}, [], []
    for minibatch in MINIBATCHES:
        _with_minibatch(trainer, minibatch)
        trainer.iterate()
        spent.clear()
        whole = loops.seconds(trainer.iterate)
        update[minibatch] = (spent["SAC"] + spent[loops.REPLAY]) / count / UPDATES
        rest = whole - sum(spent.values())
        steps.append((spent["acting"] + rest) / count / trainer.irl.steps_per_iteration)
        densities.append(spent["log pi"] / count / _tabulated(trainer.settings))
    trainer.world.environments.close()
    return {
        "step": median(steps),
        "update": update,
        "density": median(densities),
        "discriminator_update": discriminator_seconds(count),
    }


def discriminator_seconds(count: int) -> dict[str, dict[int, float]]:
    """One task's share of an update of a method's discriminators among ``count``, by method and minibatch."""
    found: dict[str, dict[int, float]] = {}
    for method in METHODS:
        own = irl_run(Settings(), "multi_task", TASKS)
        trainer = loops.generators(loops.members_of(TASKS, count), method, own, policies=1)
        found[method] = {minibatch: _discriminating(trainer, minibatch) / count for minibatch in MINIBATCHES}
        trainer.world.environments.close()
    # one of an extension may have any number of discriminators: the costliest of ours stands for it
    return found | {DEFAULT: max(found.values(), key=lambda rates: rates[max(rates)])}


def _discriminating(trainer: IrlTrainer, minibatch: int) -> float:
    _with_minibatch(trainer, minibatch)
    trainer._update_discriminators()
    return min(loops.seconds(trainer._update_discriminators) for _ in range(3)) / trainer.irl.discriminator_updates


def _with_minibatch(trainer: IrlTrainer, minibatch: int) -> None:
    """Give a trainer minibatches of this size, and fewer updates than the desk scale's."""
    own, irl = trainer.settings, trainer.irl
    discriminator = irl.discriminator.model_copy(update={"minibatch": minibatch})
    fewer = {"generator_updates": UPDATES, "discriminator_updates": UPDATES // 4, "discriminator": discriminator}
    trainer.irl = irl.model_copy(update=fewer)
    sac = own.sac.model_copy(update={"minibatch": minibatch})
    trainer.settings = own.model_copy(update={"irl": trainer.irl, "sac": sac})


def _tabulated(own: IrlRunSettings) -> int:
    """Transitions, times policies, that one iteration tabulates with full memories."""
    shown = own.demonstration_episodes * own.evaluation.episode_steps
    return shown + (2 * own.irl.generator_replay - 1) * own.irl.steps_per_iteration


def lone_step() -> float:
    """Of a lone agent of the desk scale, with its share of an update."""
    training = loops.agents([(USUAL, 0)], SacSettings(), EPISODE)
    return sum(loops.seconds(training.episode) for _ in range(TURNS)) / (TURNS * EPISODE)


def slowdown(jobs: int) -> float:
    """How much slower one of ``jobs`` simultaneous learners is than a lone one."""

    def together(count: int) -> float:
        command = [sys.executable, "-c", ALONE]
        running = [subprocess.Popen(command, stdout=subprocess.PIPE, text=True) for _ in range(count)]
        return mean(float(job.communicate()[0]) for job in running)

    return max(1.0, together(jobs) / together(1))


def _spent(code: str) -> float:
    """CPU seconds of a Python that runs ``code``."""

    def children() -> float:
        used = resource.getrusage(resource.RUSAGE_CHILDREN)
        return used.ru_utime + used.ru_stime

    before = children()
    subprocess.run([sys.executable, "-c", code], check=True)
    return children() - before
