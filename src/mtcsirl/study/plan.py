"""What a study costs before it runs: jobs, core-hours, wall time, memory and disk, from measured rates.

``study/calibration.json`` holds the rates of one machine; ``mtcsirl calibrate`` measures another one. The model is the
sum of what a job does: start-up, environment steps, gradient steps, trial and final episodes. A test holds its parts
against each other; the start page of a finished study gives the cost as measured.
"""

from collections.abc import Iterable
from dataclasses import dataclass
from functools import singledispatch
from pathlib import Path

import numpy as np

from mtcsirl.files.storage import read_json
from mtcsirl.settings import EvaluationSettings, Settings
from mtcsirl.settings.base import Frozen
from mtcsirl.settings.loading import validate
from mtcsirl.settings.runs import AgentRunSettings, IrlRunSettings
from mtcsirl.study.runs import AgentRun, AnyRun, Baseline, Demonstrations, Expert, IrlRun, Runs, Score, Transfer

CALIBRATION = Path(__file__).with_name("calibration.json")
BYTES_PER_TRANSITION = 4 * (39 + 4 + 39 + 1)
SCORE_SETS = 5
"""Transition sets of score_reward that are rolled out."""


class Rates(Frozen):
    """Measured on one idle core; seconds unless the name says otherwise. Minibatches are keys of ``*_update``."""

    machine: str
    start_up: float
    environment_step: dict[str, float]
    action: float
    sac_update: dict[int, float]
    lockstep: float
    """What an agent's gradient step costs among those of several generators, as a share of a lone one's."""
    discriminator_update: dict[int, float]
    slowdown: float
    """Factor on everything when every core is busy."""
    base_memory_mib: float
    agent_disk_mib: float
    bootstrap: float

    def step(self, task: str) -> float:
        """One environment step of ``task`` with the action for it."""
        return self.environment_step.get(task, self.environment_step["default"]) + self.action

    def update(self, rates: dict[int, float], minibatch: int) -> float:
        """Seconds per gradient step at ``minibatch``: linear between, and proportional beyond, the measured ones."""
        sizes = sorted(rates)
        if minibatch > sizes[-1]:
            return rates[sizes[-1]] * minibatch / sizes[-1]
        return float(np.interp(minibatch, sizes, [rates[size] for size in sizes]))


@dataclass(frozen=True)
class Cost:
    """One job on one core."""

    seconds: float
    memory_mib: float
    disk_mib: float


def load_rates(path: Path | str = CALIBRATION) -> Rates:
    """The rates in a calibration file."""
    return validate(Rates, read_json(path))


@singledispatch
def cost(run: AnyRun, settings: Settings, rates: Rates) -> Cost:
    """What one run takes."""
    raise TypeError(f"no cost model for {run.stage}")


@cost.register(Expert)
@cost.register(Baseline)
@cost.register(Transfer)
def _of_agent(run: AgentRun, settings: Settings, rates: Rates) -> Cost:
    return _agent(run.settings(settings), run.task, rates)


@cost.register
def _of_demonstrations(run: Demonstrations, settings: Settings, rates: Rates) -> Cost:
    own = run.settings(settings)
    steps = own.episodes * own.episode_steps
    memory = rates.base_memory_mib + steps * 4 * BYTES_PER_TRANSITION / 2**20
    return Cost(rates.start_up + steps * rates.step(run.task), memory, steps * BYTES_PER_TRANSITION / 2**20)


@cost.register
def _of_irl(run: IrlRun, settings: Settings, rates: Rates) -> Cost:
    return _irl(run.settings(settings), [task for task, _ in run.members], rates)


@cost.register
def _of_score(run: Score, settings: Settings, rates: Rates) -> Cost:
    score = run.settings(settings).score
    seconds = rates.start_up + SCORE_SETS * score.transitions * rates.step(run.task)
    return Cost(seconds + score.bootstrap * rates.bootstrap, rates.base_memory_mib, 1.0)


def _agent(own: AgentRunSettings, task: str, rates: Rates) -> Cost:
    updates = (own.steps - own.sac.random_steps) * own.sac.updates_per_step
    trials = own.steps // own.progress.select_every * own.progress.select_episodes * own.evaluation.episode_steps
    steps = own.steps + trials + _evaluation_steps(own.evaluation)
    seconds = steps * rates.step(task) + max(updates, 0) * rates.update(rates.sac_update, own.sac.minibatch)
    memory = rates.base_memory_mib + own.steps * BYTES_PER_TRANSITION / 2**20
    return Cost(rates.start_up + seconds, memory, rates.agent_disk_mib)


def _irl(own: IrlRunSettings, tasks: list[str], rates: Rates) -> Cost:
    irl = own.irl
    rounds = irl.warm_up_iterations + irl.iterations
    alone = rates.update(rates.sac_update, own.sac.minibatch)
    update = irl.generator_updates * alone * (rates.lockstep if len(tasks) > 1 else 1.0)
    discriminate = irl.discriminator_updates * rates.update(rates.discriminator_update, irl.discriminator.minibatch)
    seconds = rates.start_up + len(tasks) * (rounds * update + irl.iterations * discriminate)
    steps = rounds * irl.steps_per_iteration
    seconds += sum((steps + _evaluation_steps(own.evaluation)) * rates.step(task) for task in tasks)
    held = min(steps, irl.generator_memory) + own.demonstration_episodes * own.evaluation.episode_steps
    memory = rates.base_memory_mib + len(tasks) * held * BYTES_PER_TRANSITION / 2**20
    kept = min(irl.generator_replay, rounds) * irl.steps_per_iteration
    return Cost(seconds, memory, len(tasks) * (rates.agent_disk_mib + kept * BYTES_PER_TRANSITION / 2**20))


def _evaluation_steps(evaluation: EvaluationSettings) -> int:
    """Stochastic and deterministic episodes."""
    return 2 * evaluation.episodes * evaluation.episode_steps


@dataclass(frozen=True)
class StagePlan:
    """All jobs of one stage."""

    stage: str
    jobs: int
    core_hours: float
    longest_minutes: float
    memory_mib: float
    disk_gib: float


def plan(study: Runs, settings: Settings, rates: Rates) -> list[StagePlan]:
    """One line per stage, in the DAG's order; core-hours are of cores that are all busy."""
    costs: dict[str, list[Cost]] = {}
    for run in study:
        costs.setdefault(run.stage, []).append(cost(run, settings, rates))
    return [_stage(stage, own, rates.slowdown) for stage, own in costs.items()]


def wall_hours(stages: Iterable[StagePlan], cores: int) -> float:
    """Hours on ``cores`` cores: the work spread evenly, or the longest chain of jobs where that is longer."""
    stages = list(stages)
    chain = sum(stage.longest_minutes for stage in stages if stage.stage not in ("train_sac", "score_reward")) / 60
    return max(sum(stage.core_hours for stage in stages) / cores, chain)


def _stage(stage: str, costs: list[Cost], slowdown: float) -> StagePlan:
    return StagePlan(
        stage,
        len(costs),
        slowdown * sum(cost.seconds for cost in costs) / 3600,
        slowdown * max(cost.seconds for cost in costs) / 60,
        max(cost.memory_mib for cost in costs),
        sum(cost.disk_mib for cost in costs) / 1024,
    )
