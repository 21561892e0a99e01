"""The stage ``score_reward``: a learned reward against the truth on named transition sets, with controls.

Every correlation says on which transitions it was taken: the same reward can correlate well where behaviour varies and
not at all on the expert's transitions, where there is nothing to explain.
"""

from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple, cast

import numpy as np
import pandas as pd
import torch

from mtcsirl.episodes.demonstrations import VECTORS, as_transitions, collect_demonstrations
from mtcsirl.episodes.policy import Policy, load_policy
from mtcsirl.errors import UserError
from mtcsirl.files.storage import read_parquet, write_csv, write_parquet
from mtcsirl.results.correlation import epic_distance, epic_values, nuisance, remove, views
from mtcsirl.results.statistics import Array, cluster_bootstrap
from mtcsirl.rewards.adapter import ground_truth
from mtcsirl.rewards.learned import LearnedReward, load_learned_reward
from mtcsirl.rewards.networks import RewardNetwork
from mtcsirl.settings.runs import DemonstrationRunSettings, ScoreRunSettings
from mtcsirl.transitions import RewardFunction, Transitions
from mtcsirl.worlds.environments import ACTION_SIZE, EPISODE_STEPS

EPIC_TRANSITIONS = 256


class TransitionSet(NamedTuple):
    """Transitions [N] as the agent sees them and the episode [N] that each belongs to."""

    transitions: Transitions
    episode: np.ndarray


class _UniformActions:
    """Uniform random actions, as a policy."""

    observation = "raw"

    def act(self, observation: np.ndarray, generator: np.random.Generator | None = None) -> np.ndarray:
        """One action [4]."""
        assert generator is not None
        return generator.uniform(-1.0, 1.0, ACTION_SIZE).astype(np.float32)


def score(
    settings: ScoreRunSettings,
    reward: Path,
    expert: Path,
    baseline: Path,
    task: str,
    target: int,
    cs_reward: str,
    seed: int,
    output: Path,
) -> None:
    """Write ``scores.csv`` and ``points.parquet`` of the learned reward in the folder ``reward``.

    Sets: ``expert`` and ``sac``, stochastic episodes of the policies in the folders ``expert`` and ``baseline`` on
    ``task`` and ``target``; ``uniform``, random actions there; ``generator``, the last rollouts of the IRL run on its
    own tasks; ``across``, all of these together, so that what differs is the policy. Statistics: see
    :mod:`mtcsirl.results.correlation`; ``epic`` is a distance, and -r_task, which no function computes, counts there
    as its own canonical form. Intervals are cluster-bootstrap intervals over episodes; the controls have none.

    Raises:
        UserError: a file is missing or damaged; the learned reward is of another cs-reward or observation.
    """
    learned = load_learned_reward(reward)
    _check(learned, reward, cs_reward, settings)
    truth = ground_truth(cs_reward, settings.environment.observation)
    functions: dict[str, RewardFunction] = {"learned": learned, **_controls(learned, truth, seed)}
    rows: list[dict[str, Any]] = []
    points: list[pd.DataFrame] = []
    sets = dict(_sets(settings, reward, expert, baseline, task, target, seed))
    for name, chosen in (sets | {"across": _together(list(sets.values()))}).items():
        for function in functions:
            rows += [
                {"transitions": name, "reward": function, **row}
                for row in score_rows(functions[function], truth, chosen, settings, seed, function == "learned")
            ]
        points.append(_points(name, chosen, truth, learned, settings.discount))
    key = {"experiment": learned.about.get("experiment", ""), "method": learned.method, "cs_reward": cs_reward}
    write_csv(output / "scores.csv", pd.DataFrame(rows).assign(**key, task=task, target=target, seed=seed))
    write_parquet(output / "points.parquet", pd.concat(points, ignore_index=True))


def score_rows(
    reward: RewardFunction,
    truth: RewardFunction,
    chosen: TransitionSet,
    settings: ScoreRunSettings,
    seed: int,
    intervals: bool = True,
) -> list[dict[str, Any]]:
    """One row per statistic of ``reward`` against ``truth`` on one transition set."""
    resamples = settings.score.bootstrap if intervals else 0
    generator = np.random.default_rng([seed, 1])
    transitions, episode = chosen
    both = views(_numpy(reward, transitions), _numpy(truth, transitions), transitions, settings.discount)
    found = {name: both.estimate(name, episode, generator, resamples) for name in both.pairs}
    pick = np.sort(generator.choice(len(episode), min(EPIC_TRANSITIONS, len(episode)), replace=False))
    part = Transitions(*(field[torch.from_numpy(pick)] for field in transitions))
    shaped = [epic_values(r, part, settings.discount, np.random.default_rng([seed, 2])) for r in (reward, truth)]
    found["epic"] = cluster_bootstrap(
        lambda index: epic_distance(shaped[0][index], shaped[1][index]),
        [episode[pick]],
        generator,
        resamples=max(resamples, 1),
    )
    return [
        {
            "statistic": name,
            "value": estimate.value,
            "low": estimate.low if intervals else np.nan,
            "high": estimate.high if intervals else np.nan,
            "n": len(pick) if name == "epic" else len(episode),
            "episodes": estimate.n,
        }
        for name, estimate in found.items()
    ]


def _check(learned: LearnedReward, folder: Path, cs_reward: str, settings: ScoreRunSettings) -> None:
    if learned.cs_reward != cs_reward:
        raise UserError(f"{folder}: learned from {learned.cs_reward} experts; ask for --cs-reward {learned.cs_reward}")
    if learned.observation != settings.environment.observation:
        raise UserError(
            f"{folder}: learned on {learned.observation!r} observations; set environment.observation to that"
        )


def _controls(learned: LearnedReward, truth: RewardFunction, seed: int) -> dict[str, RewardFunction]:
    """f = r_cs, 0, an untrained network and -r_task: what each statistic says when the answer is known."""
    untrained = RewardNetwork(learned.network.architecture, random=torch.Generator().manual_seed(seed))
    return {
        "truth": truth,
        "zero": lambda transitions: torch.zeros_like(transitions.task_reward),
        "random": untrained,
        "minus_task": lambda transitions: -transitions.task_reward,
    }


def _sets(
    settings: ScoreRunSettings, reward: Path, expert: Path, baseline: Path, task: str, target: int, seed: int
) -> Iterator[tuple[str, TransitionSet]]:
    policies = {"expert": load_policy(expert), "sac": load_policy(baseline), "uniform": _UniformActions()}
    count, observation = settings.score.transitions, settings.environment.observation
    steps = min(EPISODE_STEPS, count)
    run = DemonstrationRunSettings(environment=settings.environment, episodes=-(-count // steps), episode_steps=steps)
    for stream, (name, policy) in enumerate(policies.items()):
        # All policies act in the same way as for demonstrations, but with random numbers of their own.
        frame = collect_demonstrations(cast(Policy, policy), task, target, run, seed=1_000 * seed + 1 + stream)
        yield name, TransitionSet(as_transitions(frame, observation), frame["episode"].to_numpy())
    columns = (*VECTORS, "task_reward", "task", "target", "episode", "step")
    yield "generator", last_episodes(read_parquet(reward / "samples.parquet", columns), count, observation)


def _together(sets: list[TransitionSet]) -> TransitionSet:
    """One set of several; no episode is in two of them."""
    episodes, first = [], 0
    for one in sets:
        episodes.append(np.unique(one.episode, return_inverse=True)[1] + first)
        first = int(episodes[-1].max()) + 1
    parts = (torch.cat(fields) for fields in zip(*(one.transitions for one in sets), strict=True))
    return TransitionSet(Transitions(*parts), np.concatenate(episodes))


def last_episodes(frame: pd.DataFrame, count: int, observation: str) -> TransitionSet:
    """The last whole episodes of every task and target of ``samples.parquet``, about ``count`` transitions in all."""
    sizes = frame.groupby(["task", "target", "episode"], sort=True).size()
    per_member = max(1, count // int(sizes.iloc[0] * len(sizes.groupby(["task", "target"]))))
    kept = sizes.groupby(["task", "target"]).tail(per_member).index
    rows = pd.MultiIndex.from_frame(frame[["task", "target", "episode"]])
    labels = kept.get_indexer(rows)
    return TransitionSet(as_transitions(frame[labels >= 0], observation), labels[labels >= 0])


def _points(
    name: str, chosen: TransitionSet, truth: RewardFunction, learned: RewardFunction, discount: float
) -> pd.DataFrame:
    columns = nuisance(chosen.transitions, discount)
    true, own = _numpy(truth, chosen.transitions), _numpy(learned, chosen.transitions)
    return pd.DataFrame(
        {
            "transitions": name,
            "episode": chosen.episode,
            "truth": true,
            "learned": own,
            "truth_rest": remove(true, columns),
            "learned_rest": remove(own, columns),
            "task_reward": chosen.transitions.task_reward.double().numpy(),
        }
    )


def _numpy(reward: RewardFunction, transitions: Transitions) -> Array:
    return reward(transitions).detach().double().numpy()
