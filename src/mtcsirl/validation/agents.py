"""Who moves the point: planners that demonstrate, and new agents that learn from r_task + f."""

from collections.abc import Callable, Mapping, Sequence

import numpy as np
import torch

from mtcsirl.agents.replay import Replay
from mtcsirl.agents.sac import FusedSac
from mtcsirl.episodes.lockstep import Outcome
from mtcsirl.irl.rollout import Act, collect
from mtcsirl.settings import SacSettings
from mtcsirl.transitions import RewardFunction, Transitions
from mtcsirl.validation.planner import Planner
from mtcsirl.validation.point_mass import ACTION_SIZE, EPISODE_STEPS, STATE_SIZE, Goal, PointMasses, as_transitions


def roll_out(act: Act, goals: Sequence[Goal], episodes: int, seed: int) -> Transitions:
    """Transitions [A, episodes x EPISODE_STEPS] of one policy per goal, from random starts."""
    columns: list[tuple[np.ndarray, ...]] = []

    def keep(observation: np.ndarray, action: np.ndarray, outcome: Outcome) -> None:
        columns.append((observation, action, outcome.next_observation, outcome.task_reward))

    collect(PointMasses(goals, seed), act, episodes * EPISODE_STEPS, EPISODE_STEPS, keep)
    return as_transitions(*(np.stack(column, axis=1) for column in zip(*columns, strict=True)))


def demonstrate(planner: Planner, goals: Sequence[Goal], episodes: int, seed: int) -> Transitions:
    """Transitions [T, episodes x EPISODE_STEPS] of the soft-optimal policy of each goal."""
    random = np.random.default_rng((seed, 1))
    crowd = np.repeat(np.array(goals), episodes, axis=0)

    def act(observation: np.ndarray) -> np.ndarray:
        return planner.act(observation, crowd, random)

    everyone = roll_out(act, [(x, y) for x, y in crowd], 1, seed)
    return Transitions(*(part.reshape(len(goals), episodes * EPISODE_STEPS, *part.shape[2:]) for part in everyone))


def train_agents(
    rewards: Mapping[str, RewardFunction], goal: Goal, sac: SacSettings, steps: int, seed: int
) -> FusedSac:
    """One new agent per f on r_task + f, for ``steps`` environment steps each; agent i has the i-th reward."""
    count = len(rewards)
    seeds = range(seed, seed + count)
    learner = FusedSac(count, sac, seeds=seeds, observation_size=STATE_SIZE, action_size=ACTION_SIZE)
    replay = Replay(seeds, steps, observation_size=STATE_SIZE, action_size=ACTION_SIZE)
    random = np.random.default_rng((seed, 2))
    due = 0.0

    def act(observation: np.ndarray) -> np.ndarray:
        if replay.size < sac.random_steps:
            return random.uniform(-1.0, 1.0, (count, ACTION_SIZE))
        return sampled(learner)(observation)

    def learn(observation: np.ndarray, action: np.ndarray, outcome: Outcome) -> None:
        nonlocal due
        replay.add(observation, action, outcome.next_observation, outcome.task_reward)
        due += sac.updates_per_step if replay.size >= sac.random_steps else 0.0
        while due >= 1.0:
            due -= 1.0
            batch = replay.sample(sac.minibatch)
            learner.update(batch.observation, batch.action, _total(rewards, batch), batch.next_observation)

    collect(PointMasses([goal] * count, seed), act, steps, EPISODE_STEPS, learn)
    return learner


def sampled(learner: FusedSac) -> Callable[[np.ndarray], np.ndarray]:
    """The stochastic policies of a learner as a function of observations [A, 4]."""
    return lambda observation: learner.act(torch.from_numpy(observation).float()).numpy()


def _total(rewards: Mapping[str, RewardFunction], batch: Transitions) -> torch.Tensor:
    each = [f(Transitions(*(part[agent] for part in batch))) for agent, f in enumerate(rewards.values())]
    return batch.task_reward + torch.stack(each)
