"""What a study costs before it runs: jobs, core-hours, wall time, memory and disk, from measured rates.

``study/calibration.json`` holds the rates of one machine; ``mtcsirl calibrate`` measures another one. The model is the
sum of what a job does: start-up, environment steps, gradient steps, trial and final episodes. A test holds its parts
against each other; the start page of a finished study gives the cost as measured.
"""

from collections.abc import Iterable
from dataclasses import dataclass
from functools import singledispatch
from math import ceil
from pathlib import Path
from typing import Annotated

import numpy as np
from pydantic import Field, field_validator

from mtcsirl.errors import UserError
from mtcsirl.files.storage import read_json
from mtcsirl.settings import EvaluationSettings, SacSettings, Settings
from mtcsirl.settings.base import Frozen
from mtcsirl.settings.loading import validate
from mtcsirl.settings.runs import AgentRunSettings, IrlRunSettings
from mtcsirl.study.memory import (
    BYTES_PER_TRANSITION,
    agent_memory,
    demonstrations_memory,
    irl_memory,
    score_memory,
    weights,
)
from mtcsirl.study.runs import AnyRun, Baseline, Demonstrations, Expert, IrlRun, Score, Transfer

CALIBRATION = Path(__file__).with_name("calibration.json")
MEASURED_HIDDEN = {"sac": (256, 256), "f": (128, 128)}
"""Hidden layers of the networks whose updates were measured."""
INPUTS = 82
"""(s, a, s') of a learned reward."""
SCORE_SETS = 5
"""Transition sets of score_reward that are rolled out."""
MEMORY_MARGIN = 1.25
OTHER_MACHINES = 2.0
"""How much slower than the calibrated one a machine may be for a run to end in its time."""
LEAST_MINUTES = 10


Seconds = Annotated[float, Field(gt=0)]
"""No rate is zero, negative or infinite: whoever measured one has measured something else."""
ByMinibatch = Annotated[dict[Annotated[int, Field(gt=0)], Seconds], Field(min_length=1)]


class Rates(Frozen):
    """Measured on one idle core; seconds unless the name says otherwise. Minibatches are keys of ``*_update``."""

    machine: Annotated[str, Field(min_length=1)]
    start_up: Seconds
    environment_step: dict[str, Seconds]
    action: Seconds
    sac_update: ByMinibatch
    lockstep: Annotated[float, Field(gt=0)]
    """What an agent's gradient step costs among those of several generators, as a share of a lone one's."""
    discriminator_update: ByMinibatch
    slowdown: Annotated[float, Field(ge=1)]
    """Factor on everything when every core is busy."""
    base_memory_mib: Annotated[float, Field(gt=0)]
    """Of a job with one environment, before it holds anything."""
    agent_disk_mib: Annotated[float, Field(gt=0)]
    bootstrap: Annotated[float, Field(ge=0)]

    @field_validator("environment_step")
    @classmethod
    def _has_a_default(cls, steps: dict[str, float]) -> dict[str, float]:
        if "default" not in steps:
            raise ValueError("must have a rate named default, for tasks that were not measured")
        return steps

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
    """The rates in a calibration file.

    Raises:
        UserError: the file is missing, empty or no JSON, or a rate is missing or cannot be.
    """
    said = read_json(path)
    if not isinstance(said, dict):
        raise UserError(f"{path}: holds no rates; write it by mtcsirl calibrate --output {path}")
    if missing := [name for name in Rates.model_fields if name not in said]:
        raise UserError(f"{path}: lacks {', '.join(missing)}; measure again by mtcsirl calibrate --output {path}")
    try:
        return validate(Rates, said)
    except UserError as error:
        reason = str(error).removeprefix("configuration: ")
        raise UserError(f"{path}: {reason}; measure again by mtcsirl calibrate --output {path}") from error


@singledispatch
def cost(run: AnyRun, settings: Settings, rates: Rates) -> Cost:
    """What one run takes."""
    raise TypeError(f"no cost model for {run.stage}")


@cost.register(Expert)
@cost.register(Baseline)
def _of_selected(run: Expert | Baseline, settings: Settings, rates: Rates) -> Cost:
    """These try their policies, and evaluate the one that they keep beside the last."""
    own = run.settings(settings)
    tries = own.progress.select_episodes * (own.steps // own.progress.select_every)
    return _agent(own, run.task, rates, tries * own.evaluation.episode_steps + 2 * _evaluation_steps(own.evaluation))


@cost.register
def _of_transfer(run: Transfer, settings: Settings, rates: Rates) -> Cost:
    own = run.settings(settings)
    return _agent(own, run.task, rates, _evaluation_steps(own.evaluation))


@cost.register
def _of_demonstrations(run: Demonstrations, settings: Settings, rates: Rates) -> Cost:
    own = run.settings(settings)
    steps = own.episodes * own.episode_steps
    memory = demonstrations_memory(steps, rates.base_memory_mib)
    return Cost(rates.start_up + steps * rates.step(run.task), memory, steps * BYTES_PER_TRANSITION / 2**20)


@cost.register
def _of_irl(run: IrlRun, settings: Settings, rates: Rates) -> Cost:
    return _irl(run.settings(settings), [task for task, _ in run.members], rates)


@cost.register
def _of_score(run: Score, settings: Settings, rates: Rates) -> Cost:
    score = run.settings(settings).score
    seconds = rates.start_up + SCORE_SETS * score.transitions * rates.step(run.task)
    memory = score_memory(run.irl.settings(settings), len(run.irl.members), rates.base_memory_mib)
    return Cost(seconds + score.bootstrap * rates.bootstrap, memory, 1.0)


def _agent(own: AgentRunSettings, task: str, rates: Rates, tried: int) -> Cost:
    """``tried``: environment steps beside training."""
    updates = max((own.steps - own.sac.random_steps) * own.sac.updates_per_step, 0)
    seconds = (own.steps + tried) * rates.step(task) + updates * _sac_update(own.sac, rates)
    return Cost(rates.start_up + seconds, agent_memory(own, rates.base_memory_mib), rates.agent_disk_mib)


def _irl(own: IrlRunSettings, tasks: list[str], rates: Rates) -> Cost:
    irl = own.irl
    rounds = irl.warm_up_iterations + irl.iterations
    update = irl.generator_updates * _sac_update(own.sac, rates) * (rates.lockstep if len(tasks) > 1 else 1.0)
    step = rates.update(rates.discriminator_update, irl.discriminator.minibatch)
    size = weights(INPUTS, irl.discriminator.hidden_sizes, 1) / weights(INPUTS, MEASURED_HIDDEN["f"], 1)
    discriminate = irl.discriminator_updates * step * size
    seconds = rates.start_up + len(tasks) * (rounds * update + irl.iterations * discriminate)
    steps = rounds * irl.steps_per_iteration
    seconds += sum((steps + _evaluation_steps(own.evaluation)) * rates.step(task) for task in tasks)
    memory = irl_memory(own, len(tasks), rates.base_memory_mib)
    kept = min(irl.generator_replay, rounds) * irl.steps_per_iteration
    return Cost(seconds, memory, len(tasks) * (rates.agent_disk_mib + kept * BYTES_PER_TRANSITION / 2**20))


def _evaluation_steps(evaluation: EvaluationSettings) -> int:
    """Stochastic episodes, and one deterministic one, which stands for all."""
    return (evaluation.episodes + 1) * evaluation.episode_steps


def _sac_update(sac: SacSettings, rates: Rates) -> float:
    """Seconds of one gradient step: the measured ones were with ``MEASURED_HIDDEN`` and two critics.

    With A and C weights of actor and critic an update multiplies 4 A + 6 n C of them per transition for n critics:
    actor in s and s' and back (2 + 2); each critic at s' (1), at (s, a) and back (3), at pi's action and back (2).
    """

    def products(hidden: tuple[int, ...], critics: int) -> int:
        return 4 * weights(39, hidden, 8) + 6 * critics * weights(43, hidden, 1)

    size = products(sac.hidden_sizes, sac.critics) / products(MEASURED_HIDDEN["sac"], 2)
    return rates.update(rates.sac_update, sac.minibatch) * size


@dataclass(frozen=True)
class Request:
    """What a workflow asks a cluster for: memory in units of 10^6 bytes, and minutes."""

    mem_mb: int
    minutes: int


def request(run: AnyRun, settings: Settings, rates: Rates, attempt: int = 1) -> Request:
    """Memory and time of one run with a margin for other machines; half as much again, each, on every further try."""
    own, more = cost(run, settings, rates), 1.5 ** (attempt - 1)
    minutes = OTHER_MACHINES * rates.slowdown * own.seconds / 60
    megabytes = MEMORY_MARGIN * own.memory_mib * 2**20 / 1e6
    return Request(ceil(megabytes * more), ceil((LEAST_MINUTES + minutes) * more))


@dataclass(frozen=True)
class StagePlan:
    """All jobs of one stage."""

    stage: str
    jobs: int
    core_hours: float
    longest_minutes: float
    memory_mib: float
    disk_gib: float


def plan(study: Iterable[AnyRun], settings: Settings, rates: Rates) -> list[StagePlan]:
    """One line per stage of the runs, in the DAG's order; core-hours are of cores that are all busy."""
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
