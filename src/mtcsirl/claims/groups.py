"""Agents of one kind over seeds and tasks: their distances to the target, and what they have in common by chance."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import pandas as pd

from mtcsirl.names import AGENTS, distance_metric
from mtcsirl.results.statistics import Summary, probability_of_improvement, summarise
from mtcsirl.settings import Settings
from mtcsirl.study.design import irl_seed

KINDS = {"train_sac": "plain SAC", "train_expert": "experts", "learn_reward": "generators", "transfer": "new agents"}


@dataclass(frozen=True)
class Group:
    """One kind of agent over seeds and tasks, judged by one cs-reward with the target value ``target``.

    ``agents``: per task a frame of the stochastic policy's metrics [seed, metric]; ``episodes``: that each of them had;
    ``last``: the same agents with their last policies where the kept ones are judged, else None. ``shared``: the IRL
    seed of each seed, where several new agents share one learned reward and are one replicate together.
    """

    stage: str
    name: str
    agents: Mapping[str, pd.DataFrame]
    cs_reward: str
    target: float
    episodes: int
    last: "Group | None" = None
    shared: Mapping[int, int] | None = None

    @property
    def folders(self) -> set[str]:
        """Folders of the runs whose numbers count."""
        known = [frame[frame[self.cs_reward].notna()] for frame in self.agents.values() if self.cs_reward in frame]
        return {folder for frame in known for folder in frame["folder"]}

    def on(self, task: str) -> "Group":
        """The group on one of its tasks."""
        last = None if self.last is None else self.last.on(task)
        return replace(self, agents={task: self.agents[task]}, last=last)

    def values(self, metric: str) -> pd.DataFrame:
        """``metric`` [replicate, task]; NaN where an agent is not usable. A replicate is a seed, or an IRL seed."""
        return self._together(self._each(metric))

    @cached_property
    def distances(self) -> pd.DataFrame:
        """d = |metric - target| of each agent [replicate, task]: two on both sides of the target are not on it."""
        return self._together((self._each(self.cs_reward) - self.target).abs())

    def _each(self, metric: str) -> pd.DataFrame:
        nothing = pd.Series(dtype=float)
        return pd.DataFrame({task: frame.get(metric, nothing) for task, frame in self.agents.items()}, dtype=float)

    def _together(self, values: pd.DataFrame) -> pd.DataFrame:
        """Means of the agents that share a learned reward; NaN if one of them is not usable."""
        if self.shared is None or values.empty:
            return values
        same = values.groupby([self.shared[seed] for seed in values.index])
        return same.mean().where(same.count().eq(same.size(), axis=0))

    @cached_property
    def metric(self) -> Summary:
        """The cs-reward's metric over seeds, mean over tasks per seed."""
        return summarise(per_seed(self.values(self.cs_reward)))

    @cached_property
    def distance(self) -> Summary:
        """d over seeds, mean over tasks per seed."""
        return summarise(per_seed(self.distances))

    @cached_property
    def gap(self) -> Summary:
        """target - metric over seeds, mean over tasks per seed: d with its sign."""
        return summarise(per_seed(self.target - self.values(self.cs_reward)))

    @cached_property
    def success(self) -> Summary:
        """Share of successful episodes over seeds, mean over tasks per seed."""
        return summarise(per_seed(self.values("success")))

    @property
    def sure_success(self) -> Summary:
        """``success`` with at least the spread that its episodes have by chance."""
        together = 1 if self.shared is None else len(self.shared) // len(set(self.shared.values()))
        return at_least_by_chance(self.success, self.episodes * len(self.agents) * together)

    @cached_property
    def step_distance(self) -> Summary:
        """E|m - tau| of single steps over seeds: no oscillation about the target hides in it. n = 0 if not recorded."""
        return summarise(per_seed(self.values(distance_metric(self.cs_reward))))


def per_seed(values: pd.DataFrame) -> pd.Series:
    """Mean over tasks of each seed [seed]; NaN if one of its tasks is not usable."""
    return values.mean(axis=1, skipna=False)


def at_least_by_chance(success: Summary, episodes: int) -> Summary:
    """The share p with a spread over seeds of at least sqrt(p (1 - p) / episodes), which so many episodes a seed have.

    Seeds that happen to agree on 9 of 10 episodes are no surer of it than seeds that do not.
    """
    mean, std, n = success
    return Summary(mean, max(std, float(np.sqrt(max(mean * (1 - mean), 0.0) / episodes))), n)


def behind(far: Group, near: Group) -> Summary:
    """d(far) - d(near) of agents of the same seed, mean over each group's tasks."""
    return summarise(per_seed(far.distances) - per_seed(near.distances))


def closer(first: Group, second: Group) -> float:
    """Probability that an agent of ``first`` is closer to the target than one of ``second``, mean over common tasks."""
    ours, theirs = first.distances, second.distances
    tasks = [task for task in ours.columns if task in theirs.columns]
    if not tasks or ours[tasks].isna().all(axis=None) or theirs[tasks].isna().all(axis=None):
        return np.nan
    return probability_of_improvement(-ours[tasks].to_numpy(), -theirs[tasks].to_numpy())


def name_of(key: Mapping[str, str]) -> str:
    """As in "plain SAC", "new agents on reach-wall's reward", "new agents on MT-CSIRL's reward of several tasks"."""
    name = KINDS[key["stage"]]
    if key["stage"] != "transfer":
        return name
    several = f"{AGENTS.get(key['method'], key['method'])}'s reward of several tasks"
    return f"{name} on {several}" if key["experiment"] == "multi_task" else f"{name} on {key['source']}'s reward"


def shared_rewards(settings: Settings) -> Mapping[int, int] | None:
    """The IRL seed of each new agent's seed; None where each has a learned reward of its own."""
    found = {seed: irl_seed(settings, seed) for seed in settings.seeds}
    return found if len(set(found.values())) < len(found) else None
