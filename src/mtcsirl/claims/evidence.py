"""What the claims are judged on: groups of agents, their distances to the target, and their preconditions."""

from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
import pandas as pd

from mtcsirl.claims.gates import failed, needed
from mtcsirl.names import EVALUATION_TARGET, LAST, distance_metric
from mtcsirl.results.published import Published
from mtcsirl.results.rows import KEY, OK, select
from mtcsirl.results.statistics import Summary, probability_of_improvement, summarise
from mtcsirl.rewards.ground_truth import COMMON_SENSE_REWARDS
from mtcsirl.settings import Settings
from mtcsirl.study.design import design
from mtcsirl.study.runs import IrlRun, Score


@dataclass(frozen=True)
class Group:
    """One kind of agent over seeds and tasks, judged by one cs-reward with the target value ``target``.

    ``agents``: per task a frame of the stochastic policy's metrics [seed, metric]; ``episodes``: that each of them had;
    ``last``: the same agents with their last policies where the kept ones are judged, else None.
    """

    stage: str
    agents: Mapping[str, pd.DataFrame]
    cs_reward: str
    target: float
    episodes: int
    last: "Group | None" = None

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
        return at_least_by_chance(self.success, self.episodes * len(self.agents))

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


@dataclass(frozen=True)
class Evidence:
    """All results of a study: ``evaluation_rows``, ``score_rows``, ``point_rows``, settings, the paper's numbers."""

    rows: pd.DataFrame
    scores: pd.DataFrame
    points: pd.DataFrame
    settings: Settings
    published: Published

    @cached_property
    def _agents(self) -> pd.DataFrame:
        """One row per agent: its key, its status, and its stochastic policy's metrics as columns.

        Where SAC and the experts have two policies (column ``kept``), this is the one that was kept.
        """
        return _wide(self.rows[self.rows["kept"] != LAST] if "kept" in self.rows else self.rows)

    @cached_property
    def _last(self) -> pd.DataFrame:
        """The same for the last policies of those that have two."""
        return _wide(self.rows[self.rows["kept"] == LAST] if "kept" in self.rows else self.rows.iloc[:0])

    @cached_property
    def _places(self) -> tuple[Mapping[Any, Any], Mapping[Any, Any]]:
        """Where the agents with one key, all seeds, stand in ``_agents`` and ``_last``."""
        key = [name for name in KEY if name != "seed"]
        return self._agents.groupby(key).indices, self._last.groupby(key).indices

    def group(
        self,
        cs_reward: str,
        tasks: Iterable[str],
        key: Mapping[str, str],
        target: int = EVALUATION_TARGET,
        seeds: Collection[int] = (),
    ) -> Group:
        """The agents with this ``key`` (stage and what else is not empty) on ``tasks``, judged by ``cs_reward``.

        ``seeds``: unless the study's, which are IRL's for generators; an ablation may have trained others as well. A
        task without any agent makes every seed's mean over tasks unknown, as a missing agent does.
        """
        seeds = seeds or (self.settings.irl_seeds if key["stage"] == "learn_reward" else self.settings.seeds)
        names = [key.get(name, "") for name in ("stage", "experiment", "method", "cs_reward", "source")]
        goal = COMMON_SENSE_REWARDS[cs_reward].target
        nothing = np.array([], dtype=int)

        def of(agents: pd.DataFrame, places: Mapping[Any, Any], last: Group | None) -> Group:
            found = {task: places.get((*names, task, target), nothing) for task in tasks}
            own = {task: agents.iloc[place] for task, place in found.items()}
            frames = {task: rows[rows["seed"].isin(list(seeds))].set_index("seed") for task, rows in own.items()}
            return Group(key["stage"], frames, cs_reward, goal, self.settings.evaluation.episodes, last)

        tasks = tuple(tasks)
        last = of(self._last, self._places[1], None) if len(self._last) else None
        return of(self._agents, self._places[0], last if last is not None and last.metric.n else None)

    def experts(self, cs_reward: str, tasks: Iterable[str]) -> Group:
        """Experts on ``tasks``."""
        return self.group(cs_reward, tasks, {"stage": "train_expert", "cs_reward": cs_reward})

    def sac(self, cs_reward: str, tasks: Iterable[str]) -> Group:
        """Plain SAC on ``tasks``."""
        return self.group(cs_reward, tasks, {"stage": "train_sac"})

    def transfers(self, source: "RewardSource", tasks: Iterable[str], target: int = EVALUATION_TARGET) -> Group:
        """New agents on ``tasks`` with the rewards of ``source``."""
        return self.group(source.cs_reward, tasks, {"stage": "transfer", **source.key}, target)

    def generators(
        self, source: "RewardSource", tasks: Iterable[str] | None = None, seeds: Collection[int] = ()
    ) -> Group:
        """The generators of ``source`` on the first of its targets, all its tasks or those given.

        ``seeds``: other than the study's IRL seeds.
        """
        key = {"stage": "learn_reward", **source.key}
        return self.group(source.cs_reward, tasks or source.tasks, key, source.targets[0], seeds)

    def blocked(self, source: "RewardSource", needs: Iterable[str], share: float) -> tuple[str, bool]:
        """Which of ``needs`` ("experts", "generators") of ``source`` failed their gate too often, or are not known to
        have passed it; ("", False) if none. True: they failed, whatever those that are missing will do.

        An expert passes if it and its demonstrations do. Of n agents the whole number nearest to ``share`` x n has to
        pass, so that one of three may fail where 80 % are asked for. Those that are missing count in n.
        """
        seeds = {"experts": source.expert_seeds(self.settings), "generators": self.settings.irl_seeds}
        keys: dict[str, dict[str, Any]] = {
            "experts": {
                "stage": ["train_expert", "collect_demonstrations"],
                "cs_reward": source.cs_reward,
                "task": list(source.tasks),
                "target": list(source.targets),
                "seed": list(source.expert_seeds(self.settings)),
            },
            "generators": {"stage": "learn_reward", **source.key, "seed": list(self.settings.irl_seeds)},
        }
        for name in needs:
            found = select(self._agents, **keys[name])
            each = [found["task"], found["target"], found["seed"]]
            passed = int((found["status"] == OK).groupby(each).all().sum())
            lost = int(failed(found["status"]).groupby(each).any().sum())
            count = len(source.tasks) * len(source.targets) * len(set(seeds[name]))
            if passed < needed(share, count):
                unknown = f", {count - passed - lost} missing" if count > passed + lost else ""
                return f"{passed} of {count} {name} passed their gate{unknown}", count - lost < needed(share, count)
        return "", False

    def scored(self, source: "RewardSource", task: str) -> pd.DataFrame:
        """The single transitions on which the rewards of ``source`` were scored for ``task``."""
        place = self._scored_places.get((*source.key.values(), task))
        return self.points.iloc[[] if place is None else place]

    def score_folders(self, source: "RewardSource", task: str) -> list[str]:
        """Folders of the scores that ``scored`` reads, below the results."""
        seeds = set(self.scored(source, task)["seed"]) if len(self.points) else set()
        runs = [run for run in self._scores if (run.task, *_key_of(run.irl)) == (task, *source.key.values())]
        return [run.folder for run in runs if run.irl.seed in seeds]

    @cached_property
    def _scores(self) -> tuple[Score, ...]:
        return tuple(design(self.settings).scores)

    @cached_property
    def _scored_places(self) -> Mapping[Any, Any]:
        """Where the points of one source and task stand, all seeds: found once, for selecting them takes as long."""
        names = ["experiment", "method", "cs_reward", "source", "task"]
        return self.points.groupby(names).indices if len(self.points) else {}


def _key_of(run: IrlRun) -> tuple[str, str, str, str]:
    return run.experiment, run.method, run.cs_reward, run.source


def _wide(rows: pd.DataFrame) -> pd.DataFrame:
    """One row per agent of the stochastic policy's rows, metrics as columns."""
    chosen = select(rows, policy="stochastic")
    return chosen.pivot(index=[*KEY, "status", "folder"], columns="metric", values="value").reset_index()


@dataclass(frozen=True)
class RewardSource:
    """Where learned rewards come from: the IRL runs of one experiment, method, cs-reward and source, all seeds."""

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

    def expert_seeds(self, settings: Settings) -> tuple[int, ...]:
        """Seeds of the experts that its IRL runs imitate: each its own, but of several targets all the first."""
        return settings.seeds[:1] if self.one_expert else settings.irl_seeds

    @property
    def one_expert(self) -> bool:
        """Whether all its seeds imitate the same experts, so that what follows is conditional on those."""
        return self.experiment == "multi_target"


def single_target(settings: Settings, cs_reward: str, task: str) -> RewardSource:
    """Section 5.1 on ``task``."""
    method = settings.single_target.method
    return RewardSource("single_target", method, cs_reward, task, (task,), (EVALUATION_TARGET,))


def multi_target(settings: Settings, cs_reward: str, task: str) -> RewardSource:
    """Section 5.2 on ``task``."""
    study = settings.multi_target
    return RewardSource("multi_target", study.method, cs_reward, task, (task,), study.train_targets)


def multi_task(settings: Settings, cs_reward: str, method: str) -> RewardSource:
    """Sections 5.3 and 5.4."""
    study = settings.multi_task
    return RewardSource("multi_task", method, cs_reward, "all", study.train_tasks, study.train_targets)
