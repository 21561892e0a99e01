"""What a run is: its key, the folder that mirrors it, its settings, what it reads and its identity.

Pure data for the DAG, the command line, the cost plan and the tests. Imports no torch and touches no file.
"""

from __future__ import annotations

import re
from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from string import Formatter
from typing import Any, ClassVar, Generic, TypeVar

from mtcsirl.files.identity import Identity
from mtcsirl.settings import Settings
from mtcsirl.settings.base import Frozen, identifying
from mtcsirl.settings.loading import merge, validate
from mtcsirl.settings.runs import (
    AgentRunSettings,
    DemonstrationRunSettings,
    IrlRunSettings,
    ScoreRunSettings,
    baseline_run,
    demonstration_run,
    expert_run,
    irl_run,
    score_run,
    transfer_run,
)
from mtcsirl.study.ablations import changes, prefix
from mtcsirl.study.code import code_of

S = TypeVar("S", bound=Frozen, covariant=True)


def varied(settings: Settings, variant: str) -> Settings:
    """``settings`` with the changes of a variant, as in ``ablation_replay/latest``; the main study has none."""
    return validate(Settings, merge(settings.model_dump(mode="json"), changes(variant))) if variant else settings


class Run(ABC, Generic[S]):
    """One job of the DAG whose settings are an ``S``."""

    stage: ClassVar[str]
    PATTERN: ClassVar[str]
    """The folder below the results, with the key's names as fields; also the wildcards of the stage's rule."""

    @property
    @abstractmethod
    def key(self) -> dict[str, Any]:
        """The fields of ``PATTERN``."""

    @abstractmethod
    def settings(self, settings: Settings) -> S:
        """The slice of the configuration that the run depends on."""

    @property
    def needs(self) -> Mapping[str, AnyRun]:
        """The runs that this one reads, by role."""
        return {}

    @property
    def about(self) -> dict[str, Any]:
        """What the stage is told beside settings and inputs: the part of the key that its numbers depend on."""
        return {name: value for name, value in self.key.items() if name != "variant"}

    @property
    def folder(self) -> str:
        """Where the run lands, below the results folder."""
        return self.PATTERN.format(**self.key)

    def identity(self, settings: Settings) -> Identity:
        """What the run is made from under ``settings``."""
        own = self.settings(settings)
        inputs = {role: identity_of(run, settings).hash for role, run in self.needs.items()}
        return identity(self.stage, self.about, own, inputs)


def identity(stage: str, about: Mapping[str, Any], own: Frozen, inputs: Mapping[str, str]) -> Identity:
    """The identity of a run with the settings ``own`` over inputs, role -> hash of their identity."""
    said = identifying(own)
    return Identity(stage, dict(about), said, code_of(stage, said, about.get("method", "")), dict(inputs))


_KNOWN: dict[tuple[AnyRun, int], tuple[Settings, Identity]] = {}


def identity_of(run: AnyRun, settings: Settings) -> Identity:
    """``run.identity(settings)``, computed once."""
    place = run, id(settings)
    if place not in _KNOWN:
        _KNOWN[place] = settings, run.identity(settings)  # keeps ``settings`` alive, so that its id stays its own
    return _KNOWN[place][1]


def read_folder(pattern: str, folder: str) -> dict[str, str] | None:
    """The key of a folder that ``pattern`` made; None if it is of another kind."""
    parts = Formatter().parse(pattern)
    found = re.fullmatch("".join(re.escape(text) + (_field(name) if name else "") for text, name, *_ in parts), folder)
    return found.groupdict() if found else None


FIELDS = {"variant": r"(?:ablations/\w+/\w+/)?", "target": r"\d+", "seed": r"\d+"}
"""What a field of a pattern may be, where that is not any name."""


def _field(name: str) -> str:
    return rf"(?P<{name}>{FIELDS.get(name, '[^/]+?')})"


@dataclass(frozen=True, order=True)
class Expert(Run[AgentRunSettings]):
    """SAC on r_task + ground-truth cs-reward."""

    stage = "train_expert"
    PATTERN = "{variant}expert/{cs_reward}/{task}-t{target}/s{seed}"
    cs_reward: str
    task: str
    target: int
    seed: int
    variant: str = ""

    @property
    def key(self) -> dict[str, Any]:
        """The fields of ``PATTERN``."""
        return _key(self, "cs_reward", "task", "target", "seed")

    def settings(self, settings: Settings) -> AgentRunSettings:
        """The slice of the configuration that the run depends on."""
        return expert_run(varied(settings, self.variant), self.task, self.cs_reward)


@dataclass(frozen=True, order=True)
class Baseline(Run[AgentRunSettings]):
    """SAC on r_task alone."""

    stage = "train_sac"
    PATTERN = "sac/{task}-t{target}/s{seed}"
    task: str
    target: int
    seed: int

    @property
    def key(self) -> dict[str, Any]:
        """The fields of ``PATTERN``."""
        return _key(self, "task", "target", "seed")

    def settings(self, settings: Settings) -> AgentRunSettings:
        """The slice of the configuration that the run depends on."""
        return baseline_run(settings, self.task)


@dataclass(frozen=True, order=True)
class Demonstrations(Run[DemonstrationRunSettings]):
    """Stochastic episodes of one expert."""

    stage = "collect_demonstrations"
    PATTERN = "demonstrations/{cs_reward}/{task}-t{target}/s{seed}"
    expert: Expert

    @property
    def key(self) -> dict[str, Any]:
        """The fields of ``PATTERN``."""
        return _key(self, "cs_reward", "task", "target", "seed")

    @property
    def needs(self) -> Mapping[str, AnyRun]:
        """The expert."""
        return {"expert": self.expert}

    @property
    def cs_reward(self) -> str:
        """The expert's."""
        return self.expert.cs_reward

    @property
    def task(self) -> str:
        """The expert's."""
        return self.expert.task

    @property
    def target(self) -> int:
        """The expert's."""
        return self.expert.target

    @property
    def seed(self) -> int:
        """The expert's."""
        return self.expert.seed

    @property
    def member(self) -> tuple[str, int]:
        """(task, target)."""
        return self.task, self.target

    def settings(self, settings: Settings) -> DemonstrationRunSettings:
        """The slice of the configuration that the run depends on."""
        return demonstration_run(settings, self.cs_reward)


@dataclass(frozen=True, order=True)
class IrlRun(Run[IrlRunSettings]):
    """Algorithm 1 or 2 over the demonstrations of T (task, target) pairs."""

    stage = "learn_reward"
    PATTERN = "{variant}irl/{experiment}/{method}/{cs_reward}/{source}/s{seed}"
    experiment: str
    method: str
    cs_reward: str
    source: str
    seed: int
    demonstrations: tuple[Demonstrations, ...] = field(compare=False)
    variant: str = ""

    @property
    def key(self) -> dict[str, Any]:
        """The fields of ``PATTERN``."""
        return _key(self, "experiment", "method", "cs_reward", "source", "seed")

    @property
    def members(self) -> tuple[tuple[str, int], ...]:
        """(task, target) of each generator."""
        return tuple(one.member for one in self.demonstrations)

    @property
    def needs(self) -> Mapping[str, AnyRun]:
        """One set of demonstrations per member."""
        return {demonstrations_role(index, *one.member): one for index, one in enumerate(self.demonstrations)}

    def settings(self, settings: Settings) -> IrlRunSettings:
        """The slice of the configuration that the run depends on."""
        tasks = {task for task, _ in self.members}
        return irl_run(varied(settings, self.variant), self.experiment, tasks, self.method)


def demonstrations_role(index: int, task: str, target: int) -> str:
    """The role of one member's demonstrations in an IRL run; generators differ by their place too."""
    return f"demonstrations {index} {task}-t{target}"


@dataclass(frozen=True, order=True)
class Transfer(Run[AgentRunSettings]):
    """A new agent from scratch with the frozen reward of ``irl``."""

    stage = "transfer"
    PATTERN = "{variant}transfer/{experiment}/{method}/{cs_reward}/{source}/{task}-t{target}/s{seed}"
    irl: IrlRun
    task: str
    target: int
    seed: int
    variant: str = ""

    @property
    def key(self) -> dict[str, Any]:
        """The fields of ``PATTERN``."""
        return _reward_key(self.irl) | _key(self, "task", "target", "seed")

    @property
    def about(self) -> dict[str, Any]:
        """Which reward it is stands in the inputs."""
        own = _key(self, "task", "target", "seed") | {"cs_reward": self.irl.cs_reward, "task_reward": self.task_reward}
        return {name: value for name, value in own.items() if name != "variant"}

    @property
    def needs(self) -> Mapping[str, AnyRun]:
        """The learned reward."""
        return {"reward": self.irl}

    @property
    def task_reward(self) -> str:
        """Table 4: MT-CSIRL+LT on a task and target that it was trained on uses its ``learned`` task reward."""
        learned = self.irl.method == "mt_csirl_lt" and (self.task, self.target) in self.irl.members
        return "learned" if learned else "known"

    def settings(self, settings: Settings) -> AgentRunSettings:
        """The slice of the configuration that the run depends on."""
        return transfer_run(varied(settings, self.variant), self.task)


@dataclass(frozen=True, order=True)
class Score(Run[ScoreRunSettings]):
    """The learned reward of ``irl`` against the truth on an evaluation task, on transitions of several policies."""

    stage = "score_reward"
    PATTERN = "scores/{experiment}/{method}/{cs_reward}/{source}/{task}-t{target}/s{seed}"
    irl: IrlRun
    task: str
    experts: tuple[Expert, ...] = field(compare=False)
    baselines: tuple[Baseline, ...] = field(compare=False)

    @property
    def key(self) -> dict[str, Any]:
        """The fields of ``PATTERN``."""
        place = {"task": self.task, "target": self.experts[0].target, "seed": self.irl.seed}
        return _reward_key(self.irl) | place

    @property
    def about(self) -> dict[str, Any]:
        """Which reward and policies these are stands in the inputs."""
        return {name: self.key[name] for name in ("cs_reward", "task", "target", "seed")}

    @property
    def needs(self) -> Mapping[str, AnyRun]:
        """The learned reward, and the policies that make transitions."""
        experts = {f"expert s{run.seed}": run for run in self.experts}
        return {"reward": self.irl, **experts, **{f"baseline s{run.seed}": run for run in self.baselines}}

    def settings(self, settings: Settings) -> ScoreRunSettings:
        """The slice of the configuration that the run depends on."""
        return score_run(settings)


AnyRun = Expert | Baseline | Demonstrations | IrlRun | Transfer | Score
AgentRun = Expert | Baseline | Transfer
KINDS: tuple[type[AnyRun], ...] = (Expert, Baseline, Demonstrations, IrlRun, Transfer, Score)
"""In the order of the DAG's stages."""


def _key(run: Any, *names: str) -> dict[str, Any]:
    return {"variant": prefix(getattr(run, "variant", ""))} | {name: getattr(run, name) for name in names}


def _reward_key(irl: IrlRun) -> dict[str, Any]:
    return {name: getattr(irl, name) for name in ("experiment", "method", "cs_reward", "source")}


@dataclass(frozen=True)
class Runs:
    """The runs of a study or of one artefact; sorted, each once, needed runs included."""

    experts: tuple[Expert, ...]
    baselines: tuple[Baseline, ...]
    demonstrations: tuple[Demonstrations, ...]
    irl_runs: tuple[IrlRun, ...]
    transfers: tuple[Transfer, ...]
    scores: tuple[Score, ...]

    def __iter__(self) -> Iterator[AnyRun]:
        """All runs in the order of the DAG's stages."""
        yield from self.experts
        yield from self.baselines
        yield from self.demonstrations
        yield from self.irl_runs
        yield from self.transfers
        yield from self.scores

    @property
    def agents(self) -> Iterator[AgentRun]:
        """The runs that train one agent each."""
        yield from self.experts
        yield from self.baselines
        yield from self.transfers

    def jobs(self) -> dict[str, int]:
        """Number of runs per stage."""
        counts: dict[str, int] = {}
        for run in self:
            counts[run.stage] = counts.get(run.stage, 0) + 1
        return counts


Study = Runs
