"""The settings of one job: the slice of the study's settings that its result depends on, and nothing else.

A job's ``settings.json`` is exactly this, so a changed key reruns the jobs that read it and no others.
"""

from collections.abc import Collection
from typing import Any

from pydantic import Field

from mtcsirl.settings.base import Frozen
from mtcsirl.settings.budgets import granted
from mtcsirl.settings.configuration import Settings
from mtcsirl.settings.irl import IrlAlgorithmSettings, IrlSettings, ScoreSettings
from mtcsirl.settings.learner import (
    EnvironmentSettings,
    EvaluationSettings,
    GateSettings,
    ProgressSettings,
    SacSettings,
)
from mtcsirl.settings.unread import sliced, unread


class AgentRunSettings(Frozen):
    """One SAC agent: expert, baseline or transfer agent."""

    environment: EnvironmentSettings = Field(default_factory=EnvironmentSettings)
    sac: SacSettings = Field(default_factory=SacSettings)
    steps: int = Field(default=40_000, gt=0, description="environment steps of training")
    cs_weight: float = Field(
        default=0.0, ge=0, description="weight of the cs-reward (ground truth or learned) beside r_task"
    )
    curriculum: bool = Field(default=False, description="weight the cs-reward by r_ave / R_MAX")
    curriculum_window: int = Field(default=256, gt=0, description="environment steps of r_ave")
    curriculum_maximum: float = Field(default=10.0, gt=0, le=10, description="R_MAX, as a reward per step")
    warm_up_success: float = Field(
        default=0.0, ge=0, le=1, description="the cs-reward counts from the first time that recent episodes succeed so"
    )
    warm_up_episodes: int = Field(default=5, gt=0, description="how many recent episodes these are")
    warm_up_steps: int = Field(default=0, ge=0, description="the cs-reward counts from here at the latest")
    scripted_steps: int = Field(default=0, ge=0, description="first actions, those of Meta-World's hand-written policy")
    scripted_noise: float = Field(default=0.0, ge=0, description="standard deviation of the noise on them")
    held_share: float = Field(default=0.0, ge=0, le=1, description="share of blocks with a random action held")
    held_steps: int = Field(default=16, gt=0, description="environment steps of a block")
    held_until: float = Field(default=0.0, ge=0, le=1, description="no such block after this share of the budget")
    evaluation: EvaluationSettings = Field(default_factory=EvaluationSettings)
    gates: GateSettings = Field(default_factory=GateSettings)
    progress: ProgressSettings = Field(default_factory=ProgressSettings)


class DemonstrationRunSettings(Frozen):
    """The demonstrations of one expert."""

    environment: EnvironmentSettings = Field(default_factory=EnvironmentSettings)
    episodes: int = Field(default=20, gt=0)
    episode_steps: int = Field(default=500, gt=0, le=500)
    gates: GateSettings = Field(default_factory=GateSettings)


class IrlRunSettings(Frozen):
    """One IRL run over T generators."""

    environment: EnvironmentSettings = Field(default_factory=EnvironmentSettings)
    sac: SacSettings = Field(default_factory=SacSettings)
    irl: IrlSettings = Field(default_factory=IrlSettings)
    scripted_steps: dict[str, int] = Field(default_factory=dict, description="as of an agent, by task")
    scripted_noise: float = Field(default=0.0, ge=0, description="as of an agent")
    demonstration_episodes: int = Field(default=20, gt=0, description="episodes of each expert that are read")
    evaluation: EvaluationSettings = Field(default_factory=EvaluationSettings)
    gates: GateSettings = Field(default_factory=GateSettings)
    progress: ProgressSettings = Field(default_factory=ProgressSettings)


class ScoreRunSettings(Frozen):
    """The correlation of one learned reward with the truth."""

    environment: EnvironmentSettings = Field(default_factory=EnvironmentSettings)
    score: ScoreSettings = Field(default_factory=ScoreSettings)
    discount: float = Field(default=0.99, ge=0, lt=1)


def _agent(settings: Settings, sac: SacSettings, task: str, budget: dict[str, int], **extra: Any) -> AgentRunSettings:
    return AgentRunSettings(
        environment=settings.environment,
        sac=sac,
        steps=granted(budget, task),
        **_scripted(settings, task),
        evaluation=settings.evaluation,
        gates=settings.gates,
        progress=settings.progress,
        **extra,
    )


def _scripted(settings: Settings, task: str) -> dict[str, Any]:
    steps = settings.exploration.scripted_steps.get(task, 0)
    return {"scripted_steps": steps, "scripted_noise": settings.exploration.scripted_noise if steps else 0.0}


def expert_run(settings: Settings, task: str, cs_reward: str) -> AgentRunSettings:
    """The settings of an expert for ``task`` and ``cs_reward``."""
    expert = settings.expert
    run = _agent(
        settings,
        expert.sac(settings.sac),
        task,
        expert.steps,
        cs_weight=expert.cs_weight.get(cs_reward, 1.0) * expert.cs_weight_factor.get(cs_reward, {}).get(task, 1.0),
        curriculum=expert.curriculum,
        curriculum_window=expert.curriculum_window,
        curriculum_maximum=expert.curriculum_maximum,
        warm_up_success=expert.warm_up_success,
        warm_up_episodes=expert.warm_up_episodes,
        warm_up_steps=granted(expert.warm_up_steps, task),
        held_share=granted(expert.held_share.get(cs_reward, {"default": 0.0}), task),
        held_steps=expert.held_steps,
        held_until=expert.held_until,
    )
    return sliced(run, unread("train_expert", cs_reward=cs_reward))


def baseline_run(settings: Settings, task: str) -> AgentRunSettings:
    """The settings of plain SAC on ``task``."""
    run = _agent(settings, settings.baseline.sac(settings.sac), task, settings.baseline.steps)
    return sliced(run, unread("train_sac"))


def transfer_run(settings: Settings, task: str) -> AgentRunSettings:
    """The settings of a transfer agent on ``task``."""
    transfer = settings.transfer
    run = _agent(
        settings,
        transfer.sac(settings.sac),
        task,
        transfer.steps,
        cs_weight=transfer.cs_weight,
        curriculum=transfer.curriculum,
    )
    return sliced(run, unread("transfer"))


def demonstration_run(settings: Settings, cs_reward: str) -> DemonstrationRunSettings:
    """The settings of the demonstrations of an expert for ``cs_reward``: as many as the hungriest experiment reads."""
    run = DemonstrationRunSettings(
        environment=settings.environment,
        episodes=max(settings.demonstrations.episodes.values()),
        episode_steps=settings.evaluation.episode_steps,
        gates=settings.gates,
    )
    return sliced(run, unread("collect_demonstrations", cs_reward=cs_reward))


def irl_run(settings: Settings, experiment: str, tasks: Collection[str], method: str = "") -> IrlRunSettings:
    """The settings of one IRL run of ``experiment`` on ``tasks`` with ``method`` (none: one that reads all keys)."""
    scripted = {task: steps for task, steps in settings.exploration.scripted_steps.items() if task in tasks and steps}
    run = IrlRunSettings(
        environment=settings.environment,
        sac=settings.irl.scaling().sac(settings.sac),
        irl=_irl(settings, experiment, tasks),
        scripted_steps=scripted,
        scripted_noise=settings.exploration.scripted_noise if scripted else 0.0,
        demonstration_episodes=settings.demonstrations.episodes[experiment],  # type: ignore[index]
        evaluation=settings.evaluation,
        gates=settings.gates,
        progress=settings.progress,
    )
    return sliced(run, unread("learn_reward", method=method))


def _irl(settings: Settings, experiment: str, tasks: Collection[str]) -> IrlSettings:
    """The algorithm as ``experiment`` has it, with the warm-up of the slowest of ``tasks``: all go through it together.

    Updates become gradient steps. An epoch is ``steps_per_iteration`` environment steps with one gradient step each;
    with G_updates counted in epochs an iteration collects that many of them, and so does each discriminator's turn see
    that many trajectories.
    """
    study, epoch = settings.irl, settings.irl.steps_per_iteration
    shared = {name: getattr(study, name) for name in IrlAlgorithmSettings.model_fields}
    discriminator, generator = study.discriminator_updates[experiment], study.generator_updates[experiment]
    in_epochs = study.generator_update == "epoch"
    own = {
        "steps_per_iteration": epoch * generator if in_epochs else epoch,
        "discriminator_updates": discriminator * (epoch if study.discriminator_update == "epoch" else 1),
        "generator_updates": generator * (epoch if in_epochs else 1),
        "warm_up_iterations": max(granted(study.warm_up_iterations, task) for task in tasks),
    }
    return IrlSettings(**{**shared, **own})


def score_run(settings: Settings) -> ScoreRunSettings:
    """The settings of the correlation of a learned reward with the truth."""
    return ScoreRunSettings(environment=settings.environment, score=settings.score, discount=settings.sac.discount)
