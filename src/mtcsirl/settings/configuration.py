"""The root of the configuration: what the study consists of."""

from collections.abc import Mapping
from typing import Annotated, Any, Literal

from pydantic import AfterValidator, Field, model_validator

from mtcsirl.extensions import METHODS as METHOD_REGISTRY
from mtcsirl.extensions import load_extensions
from mtcsirl.names import (
    CS_REWARDS,
    EVALUATION_TARGET,
    HIGHEST_SEED,
    METHODS,
    SINGLE_TASKS,
    TARGETS_PER_TASK,
    TRAIN_TASKS,
    UNSEEN_TASKS,
)
from mtcsirl.rewards.ground_truth import COMMON_SENSE_REWARDS
from mtcsirl.settings.base import Frozen, key
from mtcsirl.settings.budgets import Budget, Iterations, Shares, Task
from mtcsirl.settings.irl import GeneratorSettings, IrlUpdateSettings, ScoreSettings, TransferSettings
from mtcsirl.settings.learner import (
    EnvironmentSettings,
    EvaluationSettings,
    GateSettings,
    LearnerSettings,
    ProgressSettings,
    RewardScaleSettings,
)
from mtcsirl.settings.paths import Folder, PathText


def _known_method(name: str) -> str:
    return _registered(name, METHOD_REGISTRY, "method")


def _known_cs_reward(name: str) -> str:
    return _registered(name, COMMON_SENSE_REWARDS, "common-sense reward")


def _registered(name: str, registry: Mapping[str, object], what: str) -> str:
    if name not in registry:
        raise ValueError(f"unknown {what} {name!r}; allowed: {', '.join(registry)}")
    return name


def _unique(values: tuple[Any, ...]) -> tuple[Any, ...]:
    if len(set(values)) != len(values):
        raise ValueError("lists an entry twice")
    return values


Tasks = Annotated[tuple[Task, ...], Field(min_length=1), AfterValidator(_unique)]
Target = Annotated[int, Field(ge=0, lt=TARGETS_PER_TASK)]
Method = Annotated[str, AfterValidator(_known_method)]
CsReward = Annotated[str, AfterValidator(_known_cs_reward)]
Targets = Annotated[tuple[Target, ...], Field(min_length=1), AfterValidator(_unique)]
Seed = Annotated[int, Field(ge=0, le=HIGHEST_SEED)]
Seeds = Annotated[tuple[Seed, ...], Field(min_length=1), AfterValidator(_unique)]
EXPERT_STEPS = {
    "default": 40_000,
    "button-press-topdown-wall": 100_000,
    "coffee-button": 100_000,
    "door-close": 60_000,
    "faucet-open": 80_000,
    "plate-slide": 80_000,
    "push-back": 100_000,
    "reach": 60_000,
    "reach-wall": 60_000,
    "window-open": 100_000,
}
AGENT_STEPS = {"default": 30_000, "button-press-topdown-wall": 30_000, "push-back": 60_000}
WARM_UP_ITERATIONS = {
    "default": 0,
    "button-press-topdown-wall": 40,
    "drawer-close": 20,
    "push-back": 110,
    "reach-wall": 20,
}
PAPER_STEPS = 250_000
"""500 epochs of 500 steps (Table 5), for every task."""


class ExplorationSettings(Frozen):
    """First actions of agents on tasks whose reward random actions never meet."""

    scripted_steps: dict[Task, Annotated[int, Field(ge=0)]] = key(
        lambda: {"push-back": 10_000, "button-press-topdown-wall": 5_000},
        "every agent on these tasks begins with so many steps of Meta-World's hand-written policy, and learns from them"
        " as from its own; generators that do not know r_task do not",
        unit="environment steps",
        paper={"push-back": 0, "button-press-topdown-wall": 0},
    )
    scripted_noise: float = key(0.3, "standard deviation of the noise on its actions", ge=0)


class SingleTargetSettings(Frozen):
    """Section 5.1: one task, one target; the reward is tried on the same task and target."""

    tasks: Tasks = key(SINGLE_TASKS, "tasks, each on its own", paper=SINGLE_TASKS)
    method: Method = key("mt_csirl", "IRL method", paper="mt_csirl")


class MultiTargetSettings(Frozen):
    """Section 5.2: one task, several targets; the reward is tried on a new target of every task."""

    tasks: Tasks = key(SINGLE_TASKS, "rows and columns of Tables 1 and 3", paper=SINGLE_TASKS)
    method: Method = key("mt_csirl", "IRL method", paper="mt_csirl")
    train_targets: Targets = key((1, 2, 3), "targets with experts; T = their number", paper=(1, 2, 3, 4, 5))

    @model_validator(mode="after")
    def _really_new(self) -> "MultiTargetSettings":
        if EVALUATION_TARGET in self.train_targets:
            raise ValueError(
                f"train_targets holds {EVALUATION_TARGET}, the new target that Tables 1 and 3 are read on; take it out"
            )
        return self


class MultiTaskSettings(Frozen):
    """Sections 5.3 and 5.4: several tasks; the reward is tried on unseen tasks."""

    train_tasks: Tasks = key(TRAIN_TASKS, "tasks with experts; rows of Table 4", paper=TRAIN_TASKS)
    train_targets: Targets = key((1,), "targets per task; T = tasks x targets", paper=(1, 2, 3, 4, 5))
    unseen_tasks: Tasks = key(UNSEEN_TASKS, "tasks of Table 2 and Figure 3; the paper names them in a missing figure")

    @model_validator(mode="after")
    def _several_and_unseen(self) -> "MultiTaskSettings":
        if len(self.train_tasks) == 1:
            raise ValueError(f"train_tasks holds {self.train_tasks[0]} alone, as single_target can; name two or more")
        both = set(self.train_tasks) & set(self.unseen_tasks)
        if both:
            raise ValueError(f"unseen_tasks also in train_tasks: {', '.join(sorted(both))}; take it out of one list")
        return self


class ExpertSettings(RewardScaleSettings):
    """SAC on r_task + weighted ground-truth cs-reward."""

    steps: Budget = key(
        lambda: dict(EXPERT_STEPS),
        "training budget per task",
        unit="environment steps",
        paper=dict.fromkeys(EXPERT_STEPS, PAPER_STEPS),
    )
    warm_up_success: float = key(
        0.6,
        "r_task alone until this share of the last warm_up_episodes succeeded, or until warm_up_steps; 0 = both from"
        " the first step. Without it tasks that pay late learn the behaviour and never the task",
        unit="share",
        paper=0,
        ge=0,
        le=1,
    )
    warm_up_episodes: int = key(5, "training episodes that warm_up_success looks at", unit="episodes", gt=0)
    warm_up_steps: Budget = key(
        lambda: {"default": 15_000, "button-press-topdown-wall": 30_000, "push-back": 60_000},
        "the cs-reward counts from here at the latest: it makes agents try what a task alone does not reward",
        unit="environment steps",
    )
    cs_weight: dict[CsReward, Annotated[float, Field(gt=0)]] = key(
        lambda: {"velocity": 20.0, "action_norm": 20.0},
        "C_v, C_n: weight of the ground-truth cs-reward beside r_task in [0, 10]",
    )
    cs_weight_factor: dict[CsReward, dict[Task, Annotated[float, Field(gt=0)]]] = key(
        lambda: {
            "velocity": {"coffee-button": 2.0, "plate-slide": 1.5},
            "action_norm": {"coffee-button": 3.0, "plate-slide": 2.0},
        },
        "factor on cs_weight per task: more where the task pays for staying where it is done",
        paper={name: dict.fromkeys(("coffee-button", "plate-slide"), 1.0) for name in CS_REWARDS},
    )
    held_share: dict[CsReward, Shares] = key(
        lambda: {
            "velocity": {"default": 0.1, "push-back": 0.0},
            "action_norm": {"default": 0.0, "coffee-button": 0.1},
        },
        "share of blocks of held_steps steps in which the agent holds one random action: frees a hand that does its"
        " task slowly and sees no gradient towards doing it fast",
        unit="share",
        paper={
            "velocity": {"default": 0.0, "push-back": 0.0},
            "action_norm": {"default": 0.0, "coffee-button": 0.0},
        },
    )
    held_steps: int = key(
        16, "length of a block; the hand needs 8 steps to its full speed", unit="environment steps", gt=0
    )
    held_until: float = key(0.75, "no such block after this share of the budget", unit="share", ge=0, le=1)
    curriculum: bool = key(
        True, "weight the ground-truth cs-reward by r_ave / R_MAX, as section 3.3 does for f", paper=False
    )
    curriculum_window: int = key(256, "window of r_ave", unit="environment steps", gt=0)
    curriculum_maximum: float = key(10.0, "R_MAX of the curriculum: 10 is the most that a task pays", gt=0, le=10)


class BaselineSettings(RewardScaleSettings):
    """SAC on r_task alone."""

    steps: Budget = key(
        lambda: dict(AGENT_STEPS),
        "training budget per task",
        unit="environment steps",
        paper=dict.fromkeys(AGENT_STEPS, PAPER_STEPS),
    )


class DemonstrationSettings(Frozen):
    """Episodes of the stochastic expert."""

    episodes: dict[Literal["single_target", "multi_target", "multi_task"], Annotated[int, Field(gt=0)]] = key(
        lambda: {"single_target": 20, "multi_target": 20, "multi_task": 20},
        "episodes of 500 steps per task and target, by experiment",
        unit="episodes",
        paper={"single_target": 120, "multi_target": 120, "multi_task": 20},
    )


class IrlStudySettings(IrlUpdateSettings, GeneratorSettings):
    """Inverse reinforcement learning."""

    warm_up_iterations: Iterations = key(
        lambda: dict(WARM_UP_ITERATIONS),
        "iterations on the task reward alone before IRL, as many as the slowest task of a run asks for; methods that"
        " do not know it spend them on IRL too",
        unit="iterations",
        paper=dict.fromkeys(WARM_UP_ITERATIONS, 0),
    )


class TransferStudySettings(TransferSettings):
    """Transfer agents with their budget."""

    steps: Budget = key(
        lambda: dict(AGENT_STEPS),
        "training budget per task",
        unit="environment steps",
        paper=dict.fromkeys(AGENT_STEPS, PAPER_STEPS),
    )


class AblationSettings(Frozen):
    """Targets ``ablation_*``, which are no part of ``all``; each trains a few agents with one setting changed."""

    tasks: Tasks = key(("reach-wall", "drawer-close"), "tasks, each on its own")
    cs_reward: CsReward = key("velocity", "common-sense reward")
    seeds: Seeds = key((0, 1, 2, 3, 4), "seeds of every variant; claim C12 needs as many as every claim")


class Settings(Frozen):
    """The whole configuration; the defaults are the desk scale."""

    scale: Literal["smoke", "desk", "paper"] = key(
        "desk",
        "smoke: numbers mean nothing; desk: shrunk until two cores do it; paper: every number that the paper gives",
    )
    results: Folder = key("results", "folder of all runs, tables and the report")
    figures: Folder = key("paper_figs", "folder of all figures")
    extensions: tuple[PathText, ...] = key((), "Python files with methods and common-sense rewards of one's own")
    seeds: Seeds = key(
        (0, 1, 2, 3, 4), "seeds of every reported agent; development uses 100 and up", paper=(0, 1, 2, 3, 4)
    )
    irl_seeds: Seeds = key(
        (0, 1, 2, 3, 4),
        "seeds of IRL runs; a transfer agent takes the run of its own seed, or cycles through them",
        paper=(0, 1, 2, 3, 4),
    )
    cs_rewards: Annotated[tuple[CsReward, ...], Field(min_length=1), AfterValidator(_unique)] = key(
        CS_REWARDS, "common-sense rewards", paper=CS_REWARDS
    )
    methods: Annotated[tuple[Method, ...], Field(min_length=1), AfterValidator(_unique)] = key(
        METHODS, "IRL methods of the multi-task experiment", paper=METHODS
    )
    single_target: SingleTargetSettings = key(SingleTargetSettings, "section 5.1")
    multi_target: MultiTargetSettings = key(MultiTargetSettings, "section 5.2")
    multi_task: MultiTaskSettings = key(MultiTaskSettings, "sections 5.3 and 5.4")
    environment: EnvironmentSettings = key(EnvironmentSettings, "observation and targets")
    sac: LearnerSettings = key(LearnerSettings, "what all agents share")
    exploration: ExplorationSettings = key(ExplorationSettings, "first actions")
    expert: ExpertSettings = key(ExpertSettings, "experts")
    baseline: BaselineSettings = key(BaselineSettings, "plain SAC")
    demonstrations: DemonstrationSettings = key(DemonstrationSettings, "demonstrations")
    irl: IrlStudySettings = key(IrlStudySettings, "inverse reinforcement learning")
    transfer: TransferStudySettings = key(TransferStudySettings, "new agents on the learned reward")
    score: ScoreSettings = key(ScoreSettings, "correlation of learned and true reward")
    evaluation: EvaluationSettings = key(EvaluationSettings, "final evaluation of every agent")
    gates: GateSettings = key(GateSettings, "what counts as learned")
    progress: ProgressSettings = key(ProgressSettings, "reports, checkpoints, selection")
    ablations: AblationSettings = key(AblationSettings, "targets ablation_*, no part of all")

    @model_validator(mode="before")
    @classmethod
    def _extended(cls, data: Any) -> Any:
        """What an extension registers can be named in the rest of the configuration."""
        files = data.get("extensions", ()) if isinstance(data, Mapping) else ()
        if isinstance(files, list | tuple) and all(isinstance(file, str) for file in files):
            load_extensions(files)
        return data
