"""What MT-CSIRL recovers where the truth is known: correlations, new agents, controls."""

from collections.abc import Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from functools import partial
from multiprocessing import get_context
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
import torch

from mtcsirl.irl.methods import make_method
from mtcsirl.irl.methods.base import Setup
from mtcsirl.irl.rollout import World
from mtcsirl.irl.trainer import IrlTrainer
from mtcsirl.results.correlation import pearson, remove
from mtcsirl.rewards.networks import RewardNetwork
from mtcsirl.settings import DiscriminatorSettings, EvaluationSettings, GeneratorSettings, IrlSettings, LearnerSettings
from mtcsirl.settings.runs import IrlRunSettings
from mtcsirl.transitions import RewardFunction, Transitions
from mtcsirl.validation.agents import demonstrate, roll_out, sampled, train_agents
from mtcsirl.validation.planner import Planner
from mtcsirl.validation.point_mass import (
    ACTION_SIZE,
    EPISODE_STEPS,
    STATE_SIZE,
    Goal,
    PointMasses,
    common_sense_reward,
    speed,
    uniform_transitions,
)

GOALS: tuple[Goal, ...] = ((0.7, 0.0), (0.0, 0.7), (-0.7, 0.0), (0.0, -0.7))
UNSEEN: Goal = (0.4, -0.3)
DISCOUNT = 0.9
EVALUATED_EPISODES = 20
DEGREE = 3
"""Degree of the polynomial in the state that stands for any potential."""


@dataclass(frozen=True)
class ValidationSettings:
    """The size of the study; the defaults take minutes on two cores."""

    seeds: tuple[int, ...] = (100, 101, 102)
    iterations: int = 60
    warm_up_iterations: int = 10
    episodes: int = 40
    agent_steps: int = 6_000
    correlated: int = 4_000
    learning_rate: float = 1e-3
    gradient_penalty: float = 0.01
    output_scale: float = 10.0
    shaping: bool = False

    def run(self) -> IrlRunSettings:
        """MT-CSIRL at temperature 1 with small networks, without the curriculum: r_task is not in [0, 10] here."""
        irl = IrlSettings(
            iterations=self.iterations,
            warm_up_iterations=self.warm_up_iterations,
            steps_per_iteration=4 * EPISODE_STEPS,
            discriminator_updates=40,
            generator_updates=100,
            generator_replay=10,
            curriculum=False,
            discriminator=DiscriminatorSettings(
                hidden_sizes=(64, 64),
                learning_rate=self.learning_rate,
                minibatch=128,
                gradient_penalty=self.gradient_penalty,
                output_scale=self.output_scale,
                shaping=self.shaping,
            ),
        )
        learner = LearnerSettings(
            hidden_sizes=(64, 64),
            policy_learning_rate=1e-3,
            critic_learning_rate=1e-3,
            discount=DISCOUNT,
            minibatch=64,
            random_steps=400,
        )
        evaluation = EvaluationSettings(episodes=1, episode_steps=EPISODE_STEPS)
        sac = GeneratorSettings(temperature=1.0, reward_scale=1.0).scaling().sac(learner)
        return IrlRunSettings(sac=sac, irl=irl, evaluation=evaluation)


class Findings(NamedTuple):
    """The study's tidy tables."""

    correlations: pd.DataFrame
    """reward, seed, transitions, statistic, value, n."""
    agents: pd.DataFrame
    """reward, seed, metric, value: new agents on the unseen goal; reward ``expert`` and ``task_only``: planners."""
    curve: pd.DataFrame
    """reward, seed, task, target, step, metric, value of the generators and discriminators."""


def recover(settings: ValidationSettings, processes: int = 1) -> Findings:
    """Run the study: per seed MT-CSIRL on four goals and on one, controls, and new agents on the unseen goal."""
    if processes <= 1:
        parts = [_one_seed(settings, seed) for seed in settings.seeds]
    else:
        with ProcessPoolExecutor(processes, get_context("spawn")) as pool:
            parts = list(pool.map(partial(_one_seed, settings), settings.seeds))
    return Findings(*(pd.concat(frames, ignore_index=True) for frames in zip(*parts, strict=True)))


def _one_seed(settings: ValidationSettings, seed: int) -> Findings:
    torch.set_num_threads(1)
    expert, task_only = Planner(DISCOUNT), Planner(DISCOUNT, cs_weight=0.0)
    trainers = {name: learn(expert, goals, settings, seed) for name, goals in _sources(seed).items()}
    rewards = controls(seed) | {name: trainer.method.discriminators["f"].network for name, trainer in trainers.items()}
    held_out = _planned(expert, task_only, settings.correlated, seed)
    correlations = []
    for name, reward in rewards.items():
        own = {"generator": _generated(trainers[name], settings, seed)} if name in trainers else {}
        correlations += _correlations(name, seed, reward, held_out | own)
    agents = new_agents(rewards, settings, seed)
    for name, planner in (("expert", expert), ("task_only", task_only)):
        agents += _behaviour(name, seed, _joined(demonstrate(planner, [UNSEEN], EVALUATED_EPISODES, seed + 3_000)))
    curve = pd.concat([_curve(trainer).assign(reward=name, seed=seed) for name, trainer in trainers.items()])
    return Findings(pd.DataFrame(correlations), pd.DataFrame(agents), curve)


def _sources(seed: int) -> dict[str, Sequence[Goal]]:
    return {"four goals": GOALS, "one goal": GOALS[seed % len(GOALS) :][:1]}


def controls(seed: int) -> dict[str, RewardFunction]:
    """The rewards whose effect theory knows."""
    random = RewardNetwork(
        Setup(IrlSettings(), 1, seed, observation_size=STATE_SIZE, action_size=ACTION_SIZE).perceptron(),
        random=torch.Generator().manual_seed(seed),
    )
    return {
        "truth": common_sense_reward,
        "zero": lambda transitions: torch.zeros_like(transitions.task_reward),
        "random": random,
        "minus task": lambda transitions: -transitions.task_reward,
    }


def learn(expert: Planner, goals: Sequence[Goal], settings: ValidationSettings, seed: int) -> IrlTrainer:
    """MT-CSIRL on demonstrations of ``expert`` for these goals, to the end."""
    run = settings.run()
    setup = Setup(run.irl, len(goals), seed, DISCOUNT, STATE_SIZE, ACTION_SIZE)
    world = World(
        members=tuple(("goal", GOALS.index(goal)) for goal in goals),
        environments=PointMasses(goals, seed),
        truth=common_sense_reward,
        measure_episode=_measure_episode,
    )
    demonstrations = demonstrate(expert, goals, settings.episodes, seed + 1_000)
    trainer = IrlTrainer(make_method("mt_csirl", setup), world, demonstrations, run, seed)
    while trainer.iteration < trainer.iterations:
        trainer.iterate()
    return trainer


def new_agents(rewards: Mapping[str, RewardFunction], settings: ValidationSettings, seed: int) -> list[dict[str, Any]]:
    """Rows on one new agent per reward, trained on the unseen goal."""
    learner = train_agents(rewards, UNSEEN, settings.run().sac, settings.agent_steps, seed)
    moves = roll_out(sampled(learner), [UNSEEN] * len(rewards), EVALUATED_EPISODES, seed + 3_000)
    return [
        row
        for agent, name in enumerate(rewards)
        for row in _behaviour(name, seed, Transitions(*(part[agent] for part in moves)))
    ]


def potentials(transitions: Transitions) -> np.ndarray:
    """Columns [N, k]: a constant and gamma phi(s') - phi(s) of every monomial phi of the state up to DEGREE."""
    before, after = _monomials(transitions.observation), _monomials(transitions.next_observation)
    return np.column_stack((np.ones(len(before)), DISCOUNT * after - before))


def _monomials(state: torch.Tensor) -> np.ndarray:
    """x^i y^j times 1, cos, sin, cos^2 and cos sin of the heading; sin^2 = 1 - cos^2 adds nothing."""
    x, y, cos, sin = state.double().numpy().T
    headings = (np.ones_like(x), cos, sin, cos**2, cos * sin)
    powers = [(i, j) for i in range(DEGREE + 1) for j in range(DEGREE + 1 - i)]
    return np.column_stack([x**i * y**j * heading for i, j in powers for heading in headings])


def _correlations(
    name: str, seed: int, reward: RewardFunction, sets: Mapping[str, Transitions]
) -> list[dict[str, Any]]:
    rows = []
    for transitions, held_out in sets.items():
        f, truth = (r(held_out).double().numpy() for r in (reward, common_sense_reward))
        columns = potentials(held_out)
        values = {"pearson": pearson(f, truth), "pearson_residual": pearson(remove(f, columns), remove(truth, columns))}
        key = {"reward": name, "seed": seed, "transitions": transitions, "n": len(f)}
        rows += [key | {"statistic": statistic, "value": value} for statistic, value in values.items()]
    return rows


def _planned(expert: Planner, task_only: Planner, count: int, seed: int) -> dict[str, Transitions]:
    """Transitions [count] on the unseen goal that nothing was trained on."""
    episodes = count // EPISODE_STEPS
    sets = {"uniform": uniform_transitions(count, UNSEEN, np.random.default_rng((seed, 4)))}
    for name, planner in (("expert", expert), ("task_only", task_only)):
        sets[name] = _joined(demonstrate(planner, [UNSEEN], episodes, seed + 2_000))
    return sets


def _generated(trainer: IrlTrainer, settings: ValidationSettings, seed: int) -> Transitions:
    """Fresh episodes of the trained generators on their own goals."""
    goals = [GOALS[index] for _, index in trainer.world.members]
    episodes = settings.correlated // EPISODE_STEPS // len(goals)
    act = sampled(trainer.sac)  # type: ignore[arg-type]
    return _joined(roll_out(act, goals, episodes, seed + 4_000))


def _joined(transitions: Transitions) -> Transitions:
    return Transitions(*(part.flatten(0, 1) for part in transitions))


def _behaviour(name: str, seed: int, moves: Transitions) -> list[dict[str, Any]]:
    """Rows on transitions [N] of whole episodes."""
    pace = speed(moves)
    last = moves.task_reward.view(-1, EPISODE_STEPS)[:, EPISODE_STEPS // 2 :]
    metrics = {"speed": pace.mean(), "speed_std": pace.std(), "task_reward": last.mean()}
    return [
        {"reward": name, "seed": seed, "metric": metric, "value": float(value)} for metric, value in metrics.items()
    ]


def _measure_episode(
    action: np.ndarray, following: np.ndarray, task_reward: np.ndarray, solved: bool
) -> dict[str, float]:
    pace = (1.0 + action[:, 1]) / 2.0
    return {"speed": float(pace.mean()), "task_reward": float(task_reward.mean()), "success": float(solved)}


def _curve(trainer: IrlTrainer) -> pd.DataFrame:
    return pd.DataFrame(trainer.curve + trainer.diagnostics).drop(columns="discriminator")


def shrunk() -> ValidationSettings:
    """The study at the size of a test."""
    return replace(
        ValidationSettings(), seeds=(100,), iterations=7, warm_up_iterations=4, agent_steps=1_500, correlated=2_000
    )
