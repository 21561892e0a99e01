"""What the claims are judged on: groups of agents, their distances to the target, and their preconditions."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import pandas as pd

from mtcsirl.names import EVALUATION_TARGET
from mtcsirl.results.published import Published
from mtcsirl.results.rows import KEY, MISSING, OK, select
from mtcsirl.results.statistics import Array, Summary, probability_of_improvement, summarise
from mtcsirl.settings import Settings


@dataclass(frozen=True)
class Group:
    """One kind of agent over seeds and tasks, judged by one cs-reward with the target value ``target``.

    ``agents``: per task a frame of the stochastic policy's metrics [seed, metric].
    """

    stage: str
    agents: Mapping[str, pd.DataFrame]
    cs_reward: str
    target: float

    def values(self, metric: str) -> pd.DataFrame:
        """``metric`` [seed, task]; NaN where an agent is not usable."""
        nothing = pd.Series(dtype=float)
        return pd.DataFrame({task: frame.get(metric, nothing) for task, frame in self.agents.items()}, dtype=float)

    @cached_property
    def distances(self) -> pd.DataFrame:
        """d = |metric - target| [seed, task]."""
        return (self.values(self.cs_reward) - self.target).abs()

    @cached_property
    def metric(self) -> Summary:
        """The cs-reward's metric over seeds, mean over tasks per seed."""
        return summarise(per_seed(self.values(self.cs_reward)))

    @cached_property
    def distance(self) -> Summary:
        """d over seeds, mean over tasks per seed."""
        return summarise(per_seed(self.distances))

    @cached_property
    def success(self) -> Summary:
        """Share of successful episodes over seeds, mean over tasks per seed."""
        return summarise(per_seed(self.values("success")))


def per_seed(values: pd.DataFrame) -> Array:
    """Mean over tasks of each seed; NaN if one of its tasks is not usable."""
    return values.mean(axis=1, skipna=False).to_numpy(dtype=float)


def closer(first: Group, second: Group) -> float:
    """Probability that an agent of ``first`` is closer to the target than one of ``second``, mean over common tasks."""
    ours, theirs = first.distances, second.distances
    tasks = [task for task in ours.columns if task in theirs.columns]
    if not tasks or ours[tasks].isna().all(axis=None) or theirs[tasks].isna().all(axis=None):
        return np.nan
    return probability_of_improvement(-ours[tasks].to_numpy(), -theirs[tasks].to_numpy())


@dataclass(frozen=True)
class Evidence:
    """All results of a study: ``evaluation_rows``, ``score_rows``, the settings and the paper's numbers."""

    rows: pd.DataFrame
    scores: pd.DataFrame
    settings: Settings
    published: Published

    @cached_property
    def _agents(self) -> pd.DataFrame:
        """One row per agent: its key, its status, and its stochastic policy's metrics as columns."""
        rows = select(self.rows, policy="stochastic")
        return rows.pivot(index=[*KEY, "status"], columns="metric", values="value").reset_index()

    @cached_property
    def _places(self) -> Mapping[Any, Any]:
        """Where the agents with one key, all seeds, stand in ``_agents``."""
        return self._agents.groupby([name for name in KEY if name != "seed"]).indices

    def group(
        self, cs_reward: str, tasks: Iterable[str], key: Mapping[str, str], target: int = EVALUATION_TARGET
    ) -> Group:
        """The agents with this ``key`` (stage and what else is not empty) on ``tasks``, judged by ``cs_reward``.

        A task without any agent makes every seed's mean over tasks unknown, as a missing agent does.
        """
        names = [key.get(name, "") for name in ("stage", "experiment", "method", "cs_reward", "source")]
        places = {task: self._places.get((*names, task, target), np.array([], dtype=int)) for task in tasks}
        agents = {task: self._agents.iloc[place].set_index("seed") for task, place in places.items()}
        return Group(key["stage"], agents, cs_reward, self.published.target(cs_reward))

    def experts(self, cs_reward: str, tasks: Iterable[str]) -> Group:
        """Experts on ``tasks``."""
        return self.group(cs_reward, tasks, {"stage": "train_expert", "cs_reward": cs_reward})

    def sac(self, cs_reward: str, tasks: Iterable[str]) -> Group:
        """Plain SAC on ``tasks``."""
        return self.group(cs_reward, tasks, {"stage": "train_sac"})

    def transfers(self, run: "Run", tasks: Iterable[str], target: int = EVALUATION_TARGET) -> Group:
        """New agents on ``tasks`` with the reward of ``run``."""
        return self.group(run.cs_reward, tasks, {"stage": "transfer", **run.key}, target)

    def generators(self, run: "Run", tasks: Iterable[str] | None = None) -> Group:
        """The generators of ``run`` on the first of its targets, all its tasks or those given."""
        return self.group(run.cs_reward, tasks or run.tasks, {"stage": "learn_reward", **run.key}, run.targets[0])

    def blocked(self, run: "Run", needs: Iterable[str], share: float) -> str:
        """Which of ``needs`` ("experts", "generators") of ``run`` failed their gate too often; "" if none did.

        An expert passes if it and its demonstrations do.
        """
        keys: dict[str, dict[str, Any]] = {
            "experts": {
                "stage": ["train_expert", "collect_demonstrations"],
                "cs_reward": run.cs_reward,
                "task": list(run.tasks),
                "target": list(run.targets),
                "seed": self.settings.seeds[0],
            },
            "generators": {"stage": "learn_reward", **run.key},
        }
        for name in needs:
            judged = select(self._agents, **keys[name])
            judged = judged[judged["status"] != MISSING]
            passed = (judged["status"] == OK).groupby([judged["task"], judged["target"], judged["seed"]]).all()
            if passed.sum() < share * len(passed):
                return f"{passed.sum()} of {len(passed)} {name} passed their gate"
        return ""


@dataclass(frozen=True)
class Run:
    """The IRL runs of one experiment, method, cs-reward and source, over all seeds."""

    experiment: str
    method: str
    cs_reward: str
    source: str
    tasks: tuple[str, ...]
    targets: tuple[int, ...]

    @property
    def key(self) -> dict[str, str]:
        """Its columns in the rows."""
        return {name: getattr(self, name) for name in ("experiment", "method", "cs_reward", "source")}


def single_target(cs_reward: str, task: str) -> Run:
    """Section 5.1 on ``task``."""
    return Run("single_target", "mt_csirl", cs_reward, task, (task,), (EVALUATION_TARGET,))


def multi_target(settings: Settings, cs_reward: str, task: str) -> Run:
    """Section 5.2 on ``task``."""
    return Run("multi_target", "mt_csirl", cs_reward, task, (task,), settings.multi_target.train_targets)


def multi_task(settings: Settings, cs_reward: str, method: str) -> Run:
    """Sections 5.3 and 5.4."""
    study = settings.multi_task
    return Run("multi_task", method, cs_reward, "all", study.train_tasks, study.train_targets)
