"""Settings of the environment, of the SAC learner and of its training loop."""

import re
from typing import Annotated, Literal, Self

from pydantic import AfterValidator, Field, model_validator

from mtcsirl.names import HIGHEST_TARGET_SEED
from mtcsirl.settings.base import Frozen, key

Positive = Annotated[float, Field(gt=0)]
Sizes = Annotated[tuple[Annotated[int, Field(gt=0)], ...], Field(min_length=1)]
"""Units of each hidden layer."""
MOST_UPDATES = 1000
"""Gradient steps per environment step at most: REDQ, known for many, takes 20, and with far more no run ends."""
Temperature = Literal["automatic"] | Positive


def _device(name: str) -> str:
    if not re.fullmatch(r"cpu|cuda(:\d{1,2})?", name):
        raise ValueError("must be cpu, cuda or cuda:INDEX")
    return name


class EnvironmentSettings(Frozen):
    """How a Meta-World task is shown to the agent."""

    observation: Literal["mapped", "raw"] = key(
        "mapped",
        "mapped = invertible linear map that lets a network read velocity; raw = as Meta-World has it",
        paper="raw",
    )
    target_seed: int = key(0, "seed from which Meta-World draws the 50 targets of a task", ge=0, le=HIGHEST_TARGET_SEED)


class LearnerSettings(Frozen):
    """The part of SAC that every agent of the suite shares (the paper's Table 5)."""

    hidden_sizes: Sizes = key((256, 256), "hidden layers of actor and critics", unit="units", paper=(256, 256))
    critics: int = key(2, "critics of an agent; their least value counts", unit="networks", absent=2, ge=1)
    policy_learning_rate: float = key(1.0e-3, "Adam step size of the actor", paper=3.0e-4, gt=0)
    critic_learning_rate: float = key(1.0e-3, "Adam step size of the critics", paper=3.0e-4, gt=0)
    temperature_learning_rate: float = key(
        3.0e-3,
        "Adam step size of the temperature, where it is automatic: it has to come down before rewards of 0.01 count",
        gt=0,
    )
    discount: float = key(
        0.97, "discount factor; with polyak, what decides how soon a distant success is learned", paper=0.99, ge=0, lt=1
    )
    polyak: float = key(1.0e-2, "soft target interpolation", paper=5.0e-3, gt=0, le=1)
    min_log_std: float = key(-20.0, "lower clamp of the policy's log standard deviation", paper=-20.0)
    max_log_std: float = key(2.0, "upper clamp of the policy's log standard deviation", paper=2.0)
    minibatch: int = key(64, "transitions per gradient step", unit="transitions", paper=500, gt=0)
    updates_per_step: float = key(0.5, "gradient steps per environment step", paper=1.0, gt=0, le=MOST_UPDATES)
    random_steps: int = key(1000, "uniform random actions before the policy acts", unit="environment steps", ge=0)
    learner: Literal["fused", "stable_baselines3"] = key(
        "fused", "fused = this package's engine; stable_baselines3 = the reference"
    )
    device: Annotated[str, AfterValidator(_device)] = key("cpu", "torch device of the learner: cpu, cuda or cuda:INDEX")

    @model_validator(mode="after")
    def _bounds(self) -> Self:
        if self.min_log_std >= self.max_log_std:
            raise ValueError(f"min_log_std = {self.min_log_std:g} must be below max_log_std = {self.max_log_std:g}")
        return self


class SacSettings(LearnerSettings):
    """A whole SAC agent: the shared part, its temperature and the scale of its reward."""

    temperature: Temperature = key("automatic", "automatic or a fixed entropy temperature", paper="automatic")
    initial_temperature: float = key(1.0, "start of the automatic temperature", gt=0)
    target_entropy: Literal["automatic"] | float = key(
        "automatic", "automatic = minus the action dimension", unit="nats"
    )
    reward_scale: float = key(1.0, "factor on the whole reward that SAC sees", gt=0)


class RewardScaleSettings(Frozen):
    """What differs between experts, baselines, generators and transfer agents: temperature and reward scale."""

    temperature: Temperature = key("automatic", "automatic or a fixed entropy temperature", paper="automatic")
    initial_temperature: float = key(0.005, "start of the automatic temperature", gt=0)
    target_entropy: Literal["automatic"] | float = key(
        "automatic", "automatic = minus the action dimension", unit="nats"
    )
    reward_scale: float = key(0.1, "factor on the whole reward that SAC sees", paper=1.0, gt=0)

    def sac(self, learner: LearnerSettings) -> SacSettings:
        """The whole agent: ``learner`` with this temperature and scale."""
        own = {name: getattr(self, name) for name in RewardScaleSettings.model_fields}
        return SacSettings(**learner.model_dump(), **own)


class EvaluationSettings(Frozen):
    """The evaluation that ends every training job."""

    episodes: int = key(10, "episodes of the stochastic and again of the deterministic policy", unit="episodes", gt=0)
    episode_steps: int = key(500, "length of an episode", unit="environment steps", paper=500, gt=0, le=500)


class GateSettings(Frozen):
    """What an agent must reach to count as having learned; an agent below its gate is marked, never dropped."""

    success: float = key(0.9, "least share of successful episodes, stochastic policy", unit="share", ge=0, le=1)
    expert_velocity: float = key(
        0.15, "expert: largest relative distance of the velocity to its target", unit="share", gt=0
    )
    expert_action_norm: float = key(
        0.05, "expert: largest relative distance of the action norm to its target", unit="share", gt=0
    )
    generator: float = key(
        0.25, "generator after IRL: largest relative distance of the metric to its target", unit="share", gt=0
    )


class ProgressSettings(Frozen):
    """How a training job reports, saves and selects."""

    checkpoint_every: int = key(
        20_000, "distance of two resume checkpoints", unit="environment steps", neutral=True, gt=0
    )
    select_every: int = key(
        5_000,
        "distance of two trials of the policy for the best one by the gate",
        unit="environment steps",
        gt=0,
    )
    select_episodes: int = key(3, "stochastic episodes of one trial; 0 keeps the last policy", unit="episodes", ge=0)
    select_training_episodes: int = key(
        5,
        "a trial also counts this many of the last training episodes: three episodes alone flatter lucky policies",
        unit="episodes",
        ge=0,
    )
    tensorboard: bool = key(False, "write TensorBoard event files beside curve.csv", neutral=True)
