"""The experimental design as pure data: which runs exist, where they land and which artefact needs them.

The one source for the DAG, the cost plan and the tests. Imports no torch and touches no file.
"""

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import ClassVar

from pydantic import BaseModel

from mtcsirl.settings import Settings
from mtcsirl.settings.loading import merge, validate
from mtcsirl.settings.runs import (
    baseline_run,
    demonstration_run,
    expert_run,
    irl_run,
    score_run,
    transfer_run,
)
from mtcsirl.study.ablations import changes, prefix


def varied(settings: Settings, variant: str) -> Settings:
    """``settings`` with the changes of a variant, as in ``ablation_replay/latest``; the main study has none."""
    return validate(Settings, merge(settings.model_dump(mode="json"), changes(variant))) if variant else settings


@dataclass(frozen=True, order=True)
class Expert:
    """SAC on r_task + ground-truth cs-reward."""

    stage: ClassVar[str] = "train_expert"
    cs_reward: str
    task: str
    target: int
    seed: int
    variant: str = ""

    @property
    def folder(self) -> str:
        """Where the run lands, below the results folder."""
        return f"{prefix(self.variant)}expert/{self.cs_reward}/{self.task}-t{self.target}/s{self.seed}"

    def settings(self, settings: Settings) -> BaseModel:
        """The slice of ``settings`` that the run depends on."""
        return expert_run(varied(settings, self.variant), self.task, self.cs_reward)


@dataclass(frozen=True, order=True)
class Baseline:
    """SAC on r_task alone."""

    stage: ClassVar[str] = "train_sac"
    task: str
    target: int
    seed: int

    @property
    def folder(self) -> str:
        """Where the run lands, below the results folder."""
        return f"sac/{self.task}-t{self.target}/s{self.seed}"

    def settings(self, settings: Settings) -> BaseModel:
        """The slice of ``settings`` that the run depends on."""
        return baseline_run(settings, self.task)


@dataclass(frozen=True, order=True)
class Demonstrations:
    """Stochastic episodes of the expert of the first seed, read by ``experiments``."""

    stage: ClassVar[str] = "collect_demonstrations"
    cs_reward: str
    task: str
    target: int
    expert: Expert
    experiments: tuple[str, ...] = field(compare=False, default=())

    @property
    def folder(self) -> str:
        """Where the run lands, below the results folder."""
        return f"demonstrations/{self.cs_reward}/{self.task}-t{self.target}"

    def settings(self, settings: Settings) -> BaseModel:
        """The slice of ``settings`` that the run depends on."""
        return demonstration_run(settings, self.experiments)


@dataclass(frozen=True, order=True)
class IrlRun:
    """Algorithm 1 or 2 over the demonstrations of T (task, target) pairs."""

    stage: ClassVar[str] = "learn_reward"
    experiment: str
    method: str
    cs_reward: str
    source: str
    seed: int
    members: tuple[tuple[str, int], ...] = field(compare=False)
    variant: str = ""

    @property
    def key(self) -> str:
        """Experiment, method, cs-reward and source as a path."""
        return f"{self.experiment}/{self.method}/{self.cs_reward}/{self.source}"

    @property
    def folder(self) -> str:
        """Where the run lands, below the results folder."""
        return f"{prefix(self.variant)}irl/{self.key}/s{self.seed}"

    def settings(self, settings: Settings) -> BaseModel:
        """The slice of ``settings`` that the run depends on."""
        tasks = {task for task, _ in self.members}
        return irl_run(varied(settings, self.variant), self.experiment, tasks, self.method)


@dataclass(frozen=True, order=True)
class Transfer:
    """A new agent from scratch with the frozen reward of ``irl``."""

    stage: ClassVar[str] = "transfer"
    irl: IrlRun
    task: str
    target: int
    seed: int
    variant: str = ""

    @property
    def folder(self) -> str:
        """Where the run lands, below the results folder."""
        return f"{prefix(self.variant)}transfer/{self.irl.key}/{self.task}-t{self.target}/s{self.seed}"

    @property
    def learned_task_reward(self) -> bool:
        """Table 4: MT-CSIRL+LT on a task and target that it was trained on uses its learned task reward."""
        return self.irl.method == "mt_csirl_lt" and (self.task, self.target) in self.irl.members

    def settings(self, settings: Settings) -> BaseModel:
        """The slice of ``settings`` that the run depends on."""
        return transfer_run(varied(settings, self.variant), self.task)


@dataclass(frozen=True, order=True)
class Score:
    """The learned reward of ``irl`` against the truth on an evaluation task."""

    stage: ClassVar[str] = "score_reward"
    irl: IrlRun
    task: str
    expert: Expert
    baseline: Baseline

    @property
    def folder(self) -> str:
        """Where the run lands, below the results folder."""
        return f"scores/{self.irl.key}/{self.task}-t{self.expert.target}/s{self.irl.seed}"

    def settings(self, settings: Settings) -> BaseModel:
        """The slice of ``settings`` that the run depends on."""
        return score_run(settings)


Run = Expert | Baseline | Demonstrations | IrlRun | Transfer | Score


@dataclass(frozen=True)
class Study:
    """Runs of a study or of one artefact; sorted, each run once, needed runs included."""

    experts: tuple[Expert, ...]
    baselines: tuple[Baseline, ...]
    demonstrations: tuple[Demonstrations, ...]
    irl_runs: tuple[IrlRun, ...]
    transfers: tuple[Transfer, ...]
    scores: tuple[Score, ...]

    def __iter__(self) -> Iterator[Run]:
        """All runs in the order of the DAG's stages."""
        yield from self.experts
        yield from self.baselines
        yield from self.demonstrations
        yield from self.irl_runs
        yield from self.transfers
        yield from self.scores

    def jobs(self) -> dict[str, int]:
        """Number of runs per stage."""
        counts: dict[str, int] = {}
        for run in self:
            counts[run.stage] = counts.get(run.stage, 0) + 1
        return counts
