"""The kinds of run: what each is told, what it reads, and where it lands."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any

from mtcsirl.settings import Settings
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
from mtcsirl.study.keys import Run, key_of, sliced, varied


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
        return key_of(self, "cs_reward", "task", "target", "seed")

    def settings(self, settings: Settings) -> AgentRunSettings:
        """The slice of the configuration that the run depends on."""
        return sliced(expert_run, varied(settings, self.variant), self.task, self.cs_reward)


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
        return key_of(self, "task", "target", "seed")

    def settings(self, settings: Settings) -> AgentRunSettings:
        """The slice of the configuration that the run depends on."""
        return sliced(baseline_run, settings, self.task)


@dataclass(frozen=True, order=True)
class Demonstrations(Run[DemonstrationRunSettings]):
    """Stochastic episodes of one expert."""

    stage = "collect_demonstrations"
    PATTERN = "demonstrations/{cs_reward}/{task}-t{target}/s{seed}"
    expert: Expert

    @property
    def key(self) -> dict[str, Any]:
        """The fields of ``PATTERN``."""
        return key_of(self, "cs_reward", "task", "target", "seed")

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
        return sliced(demonstration_run, settings, self.cs_reward)


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
        return key_of(self, "experiment", "method", "cs_reward", "source", "seed")

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
        tasks = frozenset(task for task, _ in self.members)
        return sliced(irl_run, varied(settings, self.variant), self.experiment, tasks, self.method)


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
        return _reward_key(self.irl) | key_of(self, "task", "target", "seed")

    @property
    def about(self) -> dict[str, Any]:
        """Which reward it is stands in the inputs."""
        own = key_of(self, "task", "target", "seed") | {
            "cs_reward": self.irl.cs_reward,
            "task_reward": self.task_reward,
        }
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
        return sliced(transfer_run, varied(settings, self.variant), self.task)


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
        return sliced(score_run, settings)


AnyRun = Expert | Baseline | Demonstrations | IrlRun | Transfer | Score
AgentRun = Expert | Baseline | Transfer
KINDS: tuple[type[AnyRun], ...] = (Expert, Baseline, Demonstrations, IrlRun, Transfer, Score)
"""In the order of the DAG's stages."""


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
