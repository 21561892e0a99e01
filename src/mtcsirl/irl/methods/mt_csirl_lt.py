"""MT-CSIRL+LT: Algorithm 2, task rewards unknown and learned."""

from torch import Tensor

from mtcsirl.irl.discriminator import Method
from mtcsirl.irl.losses import Adversarial, entire_reward_logit, interpolated_points
from mtcsirl.irl.methods.base import Setup, penalised
from mtcsirl.rewards.mixture import mixed


def half_of_entire_reward_logit(f: Tensor, task_reward: Tensor, log_pi: Tensor, temperature: Tensor) -> Tensor:
    """Equations 8 and 9 for two rewards that add up: logit = f / (tau / 2) - log pi.

    Each discriminator of the printed equations alone explains the whole expert, and the generator is paid twice
    (log pi enters the sum of the two rewards twice, entropy once). With half the temperature the sum of both rewards
    is the reward of a soft-optimal expert at temperature tau.
    """
    return entire_reward_logit(f, task_reward, log_pi, temperature / 2)


def mt_csirl_lt(setup: Setup) -> Method:
    """Per-task discriminators of equation 8 and a shared one of equation 9; generators get r_phi_t + alpha f."""
    logit = entire_reward_logit if setup.irl.logit_temperature == "as_printed" else half_of_entire_reward_logit
    loss = penalised(Adversarial(logit), setup.irl.discriminator.gradient_penalty, interpolated_points)
    return Method(
        discriminators={
            "task": setup.per_task(setup.perceptron(), loss),
            "f": setup.shared(setup.perceptron(), loss),
        },
        policy_reward=lambda task_reward, learned, alpha: mixed(learned["task"], learned["f"], alpha),
        knows_task_reward=False,
        uses_curriculum=setup.irl.unknown_task_curriculum,
    )
