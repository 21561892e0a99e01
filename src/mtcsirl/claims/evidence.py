"""What the claims are judged on: the agents of a study in groups, their preconditions, and points of rewards."""

from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import pandas as pd

from mtcsirl.claims.gates import failed, needed, unusable
from mtcsirl.claims.groups import Group, name_of, shared_rewards
from mtcsirl.names import EVALUATION_TARGET, LAST
from mtcsirl.results.published import Published
from mtcsirl.results.rows import KEY, OK, select
from mtcsirl.rewards.ground_truth import COMMON_SENSE_REWARDS
from mtcsirl.settings import Settings
from mtcsirl.study.design import design
from mtcsirl.study.runs import IrlRun, Score


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
        goal, nothing = COMMON_SENSE_REWARDS[cs_reward].target, np.array([], dtype=int)
        shared = shared_rewards(self.settings) if key["stage"] == "transfer" else None

        def of(agents: pd.DataFrame, places: Mapping[Any, Any], last: Group | None) -> Group:
            found = {task: places.get((*names, task, target), nothing) for task in tasks}
            own = {task: agents.iloc[place] for task, place in found.items()}
            frames = {task: rows[rows["seed"].isin(list(seeds))].set_index("seed") for task, rows in own.items()}
            episodes = self.settings.evaluation.episodes
            return Group(key["stage"], name_of(key), frames, cs_reward, goal, episodes, last, shared)

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

    def blocked(
        self, source: "RewardSource", needs: Iterable[str], share: float, irl_seeds: Collection[int] = ()
    ) -> tuple[str, bool]:
        """Which of ``needs`` ("experts", "generators") of ``source`` failed their gate too often, or are not known to
        have passed it; ("", False) if none. True: they failed, whatever those that are missing will do.

        An expert passes if it and its demonstrations do. Of n agents the whole number nearest to ``share`` x n has to
        pass, so that one of three may fail where 80 % are asked for. Those that are missing count in n.
        ``irl_seeds``: of its IRL runs, unless the study's.
        """
        irl_seeds = tuple(irl_seeds) or self.settings.irl_seeds
        seeds = {"experts": source.expert_seeds(self.settings, irl_seeds), "generators": irl_seeds}
        keys: dict[str, dict[str, Any]] = {
            "experts": {
                "stage": ["train_expert", "collect_demonstrations"],
                "cs_reward": source.cs_reward,
                "task": list(source.tasks),
                "target": list(source.targets),
                "seed": list(seeds["experts"]),
            },
            "generators": {"stage": "learn_reward", **source.key, "seed": list(irl_seeds)},
        }
        for name in needs:
            found = select(self._agents, **keys[name])
            each = [found["task"], found["target"], found["seed"]]
            passed = int((found["status"] == OK).groupby(each).all().sum())
            lost = int(failed(found["status"]).groupby(each).any().sum())
            count = len(source.tasks) * len(source.targets) * len(set(seeds[name]))
            if passed < needed(share, count):
                useless = int((unusable(found["status"]) & ~failed(found["status"])).groupby(each).any().sum())
                missing = max(count - passed - lost - useless, 0)
                unknown = f", {missing} missing" if missing else ""
                unknown += f", {useless} without an evaluation that counts" if useless else ""
                return f"{passed} of {count} {name} passed their gate{unknown}", count - lost < needed(share, count)
        return "", False

    def scored(self, source: "RewardSource", task: str) -> pd.DataFrame:
        """The single transitions on which the rewards of ``source`` were scored for ``task``."""
        place = self._scored_places.get((*source.key.values(), task))
        own = self.points.iloc[[] if place is None else place]
        return own[own["seed"].isin(list(self.settings.irl_seeds))] if len(own) else own

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

    def expert_seeds(self, settings: Settings, irl_seeds: tuple[int, ...]) -> tuple[int, ...]:
        """Seeds of the experts that its IRL runs imitate: each its own, but of several targets all the first."""
        return settings.seeds[:1] if self.one_expert else irl_seeds

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
