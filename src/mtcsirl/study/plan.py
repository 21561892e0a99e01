"""What a study costs before it runs: jobs, core-hours, wall time, memory and disk, from measured rates.

The model is the sum of what a job does: start-up, environment steps, gradient steps, trial and final episodes, each
times its rate (:mod:`mtcsirl.study.rates`). ``mtcsirl plan --against-runs`` holds it against the runs that are done.
"""

from collections.abc import Iterable
from dataclasses import dataclass
from functools import singledispatch
from math import ceil

from mtcsirl.settings import EvaluationSettings, SacSettings, Settings
from mtcsirl.settings.runs import AgentRunSettings, IrlRunSettings
from mtcsirl.settings.unread import METHODS
from mtcsirl.study.memory import (
    BYTES_PER_TRANSITION,
    SAMPLED_ROLLOUTS,
    agent_memory,
    demonstrations_memory,
    irl_memory,
    score_memory,
    weights,
)
from mtcsirl.study.rates import DEFAULT, AgentRates, GeneratorRates, Rates, by_minibatch, share
from mtcsirl.study.runs import AnyRun, Baseline, Demonstrations, Expert, IrlRun, Score, Transfer

MEASURED_HIDDEN = {"sac": (256, 256), "f": (128, 128)}
"""Hidden layers of the networks whose updates were measured."""
INPUTS = 82
"""(s, a, s') of a learned reward."""
EPISODE_STEPS = 500
"""Of Meta-World's episodes, in which policies act for a score."""
AGENT_DISK_MIB = 0.6
MEMORY_MARGIN = 1.25
OTHER_MACHINES = 2.0
"""How much slower than the calibrated one a machine may be for a run to end in its time."""
LEAST_MINUTES = 10


@dataclass(frozen=True)
class Cost:
    """One job on one core."""

    seconds: float
    memory_mib: float
    disk_mib: float


@singledispatch
def cost(run: AnyRun, settings: Settings, rates: Rates, together: int = 1) -> Cost:
    """What one run takes; ``together``: how many agents train in lockstep, of which this is one."""
    raise TypeError(f"no cost model for {run.stage}")


@cost.register(Expert)
@cost.register(Baseline)
def _of_selected(run: Expert | Baseline, settings: Settings, rates: Rates, together: int = 1) -> Cost:
    """These try their policies, and evaluate the one that they keep beside the last."""
    own = run.settings(settings)
    tries = own.progress.select_episodes * (own.steps // own.progress.select_every)
    tried = tries * own.evaluation.episode_steps + 2 * _evaluation_steps(own.evaluation)
    return _agent(own, run.task, rates, tried, together)


@cost.register
def _of_transfer(run: Transfer, settings: Settings, rates: Rates, together: int = 1) -> Cost:
    own = run.settings(settings)
    return _agent(own, run.task, rates, _evaluation_steps(own.evaluation), together)


@cost.register
def _of_demonstrations(run: Demonstrations, settings: Settings, rates: Rates, together: int = 1) -> Cost:
    own = run.settings(settings)
    steps = own.episodes * own.episode_steps
    seconds = rates.start_up + rates.frames + steps * (_episode_step(run.task, rates) + rates.recorded)
    return Cost(seconds, demonstrations_memory(steps), steps * BYTES_PER_TRANSITION / 2**20)


@cost.register
def _of_irl(run: IrlRun, settings: Settings, rates: Rates, together: int = 1) -> Cost:
    own, generators = run.settings(settings), len(run.members)
    irl = own.irl
    rounds = irl.warm_up_iterations + irl.iterations
    seconds = rates.start_up + rates.frames + generators * _of_a_generator(own, run.method, generators, rates)
    evaluated = _evaluation_steps(own.evaluation)
    for task, _ in run.members:
        seconds += rounds * irl.steps_per_iteration * rates.simulated(task) + evaluated * _episode_step(task, rates)
    kept = min(irl.generator_replay, rounds) * irl.steps_per_iteration
    disk = generators * (AGENT_DISK_MIB + kept * BYTES_PER_TRANSITION / 2**20)
    return Cost(seconds, irl_memory(own, generators), disk)


@cost.register
def _of_score(run: Score, settings: Settings, rates: Rates, together: int = 1) -> Cost:
    score = run.settings(settings).score
    acted, sizes = scored_sizes(run, score.transitions, settings)
    seconds = rates.start_up + rates.frames + acted * (_episode_step(run.task, rates) + rates.recorded)
    seconds += len(sizes) * rates.scored + score.bootstrap * sum(sizes) * rates.resampled
    return Cost(seconds, score_memory(run.irl.settings(settings), len(run.irl.members)), 1.0)


def scored_sizes(run: Score, wanted: int, settings: Settings) -> tuple[int, list[int]]:
    """Transitions that policies act for, and those of each transition set (results/scoring.py).

    Whole episodes, as many of each policy of a set: the experts, the baselines, and the one of random actions. Then the
    generators' last ones, as far as there are so many, and equal parts of these four.
    """
    steps = min(EPISODE_STEPS, wanted)
    own = [
        steps * policies * ceil(wanted / (steps * policies)) for policies in (len(run.experts), len(run.baselines), 1)
    ]
    irl, members = run.irl.settings(settings).irl, len(run.irl.members)
    rollouts = min(SAMPLED_ROLLOUTS, irl.warm_up_iterations + irl.iterations)
    per_member = max(1, wanted // (irl.steps_per_iteration * members))
    last = min(per_member, rollouts) * irl.steps_per_iteration * members
    return sum(own), [*own, last, 4 * min(*own, last)]


def _agent(own: AgentRunSettings, task: str, rates: Rates, tried: int, together: int) -> Cost:
    """``tried``: environment steps beside training."""
    updates = max((own.steps - own.sac.random_steps) * own.sac.updates_per_step, 0)
    step = share(rates.agents, together, lambda loop: loop.step)
    update = _update(rates.agents, together, own.sac)
    seconds = own.steps * (rates.simulated(task) + step) + updates * update + tried * _episode_step(task, rates)
    # what a process does once is done once for all that train in it
    once = (rates.start_up + rates.frames) / together
    return Cost(once + seconds, agent_memory(own), AGENT_DISK_MIB)


def _of_a_generator(own: IrlRunSettings, method: str, generators: int, rates: Rates) -> float:
    """Seconds of one of so many generators, without start-up and simulation."""
    irl = own.irl
    rounds, taught = irl.warm_up_iterations + irl.iterations, discriminating_iterations(own, method)
    step = share(rates.generators, generators, lambda loop: loop.step)
    seconds = rounds * irl.steps_per_iteration * step
    seconds += rounds * irl.generator_updates * _update(rates.generators, generators, own.sac)
    seconds += taught * irl.discriminator_updates * _discriminator_update(own, method, generators, rates)
    seconds += tabulated(own, taught) * share(rates.generators, generators, lambda loop: loop.density)
    return seconds + min(SAMPLED_ROLLOUTS, rounds) * irl.steps_per_iteration * rates.recorded


def discriminating_iterations(own: IrlRunSettings, method: str) -> int:
    """Iterations in which discriminators learn: a method that knows no task reward has no warm-up."""
    knows = "irl.task_reward_scale" not in METHODS.get(method, ())
    return own.irl.iterations + (0 if knows else own.irl.warm_up_iterations)


def tabulated(own: IrlRunSettings, taught: int) -> int:
    """Transitions, times policies, of which an IRL run tabulates log pi for each generator (irl/densities.py).

    In each iteration the newest policy's of the demonstrations and of the window, and that of the others of the mixture
    in the newest rollout.
    """
    irl = own.irl
    rounds = irl.warm_up_iterations + irl.iterations
    policies = irl.generator_replay if irl.logit_density == "mixture" else 1
    iterations = min(rounds, taught + policies - 1)
    shown = own.demonstration_episodes * own.evaluation.episode_steps
    windows = sum(min(end, irl.generator_replay) for end in range(rounds - iterations + 1, rounds + 1))
    others = sum(min(end, policies) - 1 for end in range(1, iterations + 1))
    return iterations * shown + (windows + others) * irl.steps_per_iteration


def _discriminator_update(own: IrlRunSettings, method: str, generators: int, rates: Rates) -> float:
    discriminator = own.irl.discriminator
    size = weights(INPUTS, discriminator.hidden_sizes, 1) / weights(INPUTS, MEASURED_HIDDEN["f"], 1)

    def measured(loop: GeneratorRates) -> float:
        by_method = loop.discriminator_update
        return by_minibatch(by_method.get(method, by_method[DEFAULT]), discriminator.minibatch)

    return size * share(rates.generators, generators, measured)


def _episode_step(task: str, rates: Rates) -> float:
    """One step of an episode outside of training."""
    return rates.simulated(task) + rates.episode_step


def _evaluation_steps(evaluation: EvaluationSettings) -> int:
    """Stochastic episodes, and one deterministic one, which stands for all."""
    return (evaluation.episodes + 1) * evaluation.episode_steps


def _update(loops: dict[int, AgentRates] | dict[int, GeneratorRates], together: int, sac: SacSettings) -> float:
    """Seconds of one gradient step: the measured ones were with ``MEASURED_HIDDEN`` and two critics.

    With A and C weights of actor and critic an update multiplies 4 A + 6 n C of them per transition for n critics:
    actor in s and s' and back (2 + 2); each critic at s' (1), at (s, a) and back (3), at pi's action and back (2).
    """

    def products(hidden: tuple[int, ...], critics: int) -> int:
        return 4 * weights(39, hidden, 8) + 6 * critics * weights(43, hidden, 1)

    size = products(sac.hidden_sizes, sac.critics) / products(MEASURED_HIDDEN["sac"], 2)
    return size * share(loops, together, lambda loop: by_minibatch(loop.update, sac.minibatch))


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
