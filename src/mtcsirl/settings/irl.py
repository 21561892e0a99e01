"""Settings of inverse reinforcement learning: discriminator, generator, iterations."""

from typing import Literal

from pydantic import Field

from mtcsirl.names import EXPERIMENTS
from mtcsirl.settings.base import Frozen, key
from mtcsirl.settings.budgets import Updates
from mtcsirl.settings.learner import RewardScaleSettings, Sizes, Temperature


class DiscriminatorSettings(Frozen):
    """The learned reward f and how it is trained."""

    hidden_sizes: Sizes = key((128, 128), "hidden layers of f", unit="units")
    learning_rate: float = key(1.0e-4, "Adam step size of f", gt=0)
    minibatch: int = key(256, "expert and again generator transitions per task and update", unit="transitions", gt=0)
    output_scale: float = key(10.0, "f = output_scale x network", gt=0)
    gradient_penalty: float = key(
        0.1, "all but VAIRL: weight of the zero-centred gradient penalty on interpolates; 0 = none", paper=0, ge=0
    )
    log_pi_clamp: float = key(10.0, "log pi is clamped to +- this in the logit", unit="nats", gt=0)
    shaping: bool = key(False, "add gamma h(s') - h(s) to the logit and leave it out of the learned reward")
    bottleneck_hidden_sizes: Sizes = key((32, 32), "VAIRL: hidden layers of the encoder", unit="units")
    bottleneck_size: int = key(32, "VAIRL: size of z", unit="units", gt=0)
    information_constraint: float = key(0.5, "VAIRL: I_c on the summed KL", unit="nats", gt=0)
    initial_beta: float = key(0.005, "VAIRL: start of the multiplier beta", ge=0)
    beta_step: float = key(1.0e-5, "VAIRL: dual step on beta; 0 keeps it fixed", ge=0)
    vairl_gradient_penalty: float = key(
        1.0, "VAIRL-GP: weight w of the zero-centred penalty w/2 E||grad||^2 on expert samples", ge=0
    )


class IrlAlgorithmSettings(Frozen):
    """Algorithms 1 and 2 but for what depends on tasks (the warm-up) or on the experiment (updates)."""

    iterations: int = key(120, "N: outer iterations after the warm-up", unit="iterations", gt=0)
    steps_per_iteration: int = key(
        500,
        "environment steps that each generator collects per iteration",
        unit="environment steps",
        paper=500,
        gt=0,
    )
    generator_replay: int = key(
        20,
        "generator samples come from the last this many iterations; 1 = latest rollout",
        unit="iterations",
        paper=1,
        gt=0,
    )
    generator_memory: int = key(
        100_000,
        "replay memory of each generator's SAC; the oldest transitions go first",
        unit="transitions",
        gt=0,
    )
    schedule: Literal["as_printed", "batched"] = key(
        "batched", "loop over tasks as printed, or one tensor program over all tasks", paper="as_printed"
    )
    curriculum: bool = key(True, "weight f in the policy reward by r_ave / R_MAX", paper=True)
    curriculum_window: int = key(
        2_560,
        "window of r_ave; over 256 steps, half an episode, one failed rollout takes f away from its generator",
        unit="environment steps",
        paper=256,
        gt=0,
    )
    curriculum_maximum: Literal["experts", "task"] = key(
        "experts",
        "R_MAX of the curriculum: what a task's experts earn per step, or 10, the most that it pays; with 10, f counts"
        " too little to keep a generator at an expert that earns less",
        paper="task",
    )
    unknown_task_curriculum: bool = key(
        False,
        "MT-CSIRL+LT: take r_ave of the curriculum from the environment, though the method does not know it",
    )
    logit_temperature: Literal["as_printed", "generator"] = key(
        "generator",
        "logit = f - log pi as printed, or f / tau - log pi with the generator's tau; they agree for tau = 1"
        " but for MT-CSIRL+LT, whose two rewards take tau / 2 each",
        paper="as_printed",
    )
    logit_density: Literal["as_printed", "mixture"] = key(
        "mixture",
        "log pi in the logit: of the current policy as printed, or of the mixture of the policies that made the"
        " generator's samples; they agree for generator_replay 1",
        paper="as_printed",
    )
    task_reward_scale: float = key(1.0, "factor on r_task in logit and policy reward", paper=1.0, gt=0)
    cs_weight: float = key(1.0, "alpha: factor on f in the policy reward beside the curriculum", paper=1.0, gt=0)
    centre: bool = key(
        False,
        "subtract from f its mean over the generators' last transitions, in the policy reward and in what is saved:"
        " no preference changes, the critics' targets move less",
        paper=False,
    )
    warm_up_temperature: Literal["automatic", "as_in_irl"] = key(
        "automatic",
        "generators in their warm-up: automatic, as plain SAC, or that of IRL; at temperature 1 the entropy bonus hides"
        " task rewards below 1, and a task that pays late is not found",
    )
    discriminator: DiscriminatorSettings = key(DiscriminatorSettings, "the learned reward")


class GeneratorSettings(Frozen):
    """The generators' temperature and scale in a study; a run has what ``scaling`` makes of them, in ``sac``."""

    temperature: Temperature = key(1.0, "generators: automatic or fixed entropy temperature", paper="automatic")
    initial_temperature: float = key(0.05, "generators: start of the automatic temperature", gt=0)
    reward_scale: float = key(
        0.1,
        "generators: factor on reward and temperature inside SAC: no policy is better or worse for it, but the critics'"
        " targets are small, as in every other agent",
        paper=1.0,
        gt=0,
    )

    def scaling(self) -> RewardScaleSettings:
        """Temperature and scale of the generators' SAC: scaled together, they leave the optimal policy as it is."""
        scale, fixed = self.reward_scale, self.temperature != "automatic"
        return RewardScaleSettings(
            temperature=scale * float(self.temperature) if fixed else "automatic",
            initial_temperature=scale * self.initial_temperature,
            reward_scale=scale,
        )


class IrlUpdateSettings(IrlAlgorithmSettings):
    """Algorithms 1 and 2 with the updates of each experiment, as the configuration has them."""

    discriminator_updates: Updates = key(
        lambda: dict.fromkeys(EXPERIMENTS, 40),
        "D_updates per task and iteration, by experiment",
        unit="updates",
        paper={"single_target": 15, "multi_target": 15, "multi_task": 10},
    )
    generator_updates: Updates = key(
        lambda: dict.fromkeys(EXPERIMENTS, 250),
        "G_updates per task and iteration, by experiment",
        unit="updates",
        paper={"single_target": 15, "multi_target": 15, "multi_task": 20},
    )
    discriminator_update: Literal["gradient_step", "epoch"] = key(
        "gradient_step", "one of D_updates: one gradient step, or as many as an epoch has steps (steps_per_iteration)"
    )
    generator_update: Literal["gradient_step", "epoch"] = key(
        "gradient_step",
        "one of G_updates: one gradient step; or an epoch as SAC has them: steps_per_iteration environment steps and as"
        " many gradient steps, so that an iteration collects G_updates times as much",
    )


class IrlSettings(IrlAlgorithmSettings):
    """Algorithms 1 and 2 as one run has them."""

    discriminator_updates: int = Field(default=40, gt=0, description="gradient steps per task and iteration")
    generator_updates: int = Field(default=250, gt=0, description="gradient steps per task and iteration")
    warm_up_iterations: int = Field(default=0, ge=0, description="that of the run's slowest task")


class TransferSettings(RewardScaleSettings):
    """New agents from scratch on r_task + f with f frozen."""

    cs_weight: float = key(1.0, "factor on f beside r_task (section 3.3: standard aggregation)", paper=1.0, gt=0)
    curriculum: bool = key(False, "weight f by r_ave / R_MAX as during IRL (section 3.3: no)", paper=False)


class ScoreSettings(Frozen):
    """Transition sets on which a learned reward is held against the truth."""

    transitions: int = key(5_000, "transitions per set", unit="transitions", gt=1)
    points: int = key(
        1_000, "transitions per set that are kept for scatter plots and claims, evenly spaced", unit="transitions", gt=1
    )
    bootstrap: int = key(500, "resamples of the cluster bootstrap by episode", unit="resamples", gt=0)
