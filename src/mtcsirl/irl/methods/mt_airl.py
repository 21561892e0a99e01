"""MT-AIRL: the baseline that learns the entire reward, shared by all tasks (Fu et al., 2018, on several tasks)."""

from mtcsirl.irl.discriminator import Method
from mtcsirl.irl.losses import Adversarial, entire_reward_logit, interpolated_points
from mtcsirl.irl.methods.base import Setup, penalised


def mt_airl(setup: Setup) -> Method:
    """Discriminators of equation 1 that share f; generators get f alone."""
    loss = penalised(Adversarial(entire_reward_logit), setup.irl.discriminator.gradient_penalty, interpolated_points)
    return Method(
        discriminators={"f": setup.shared(setup.perceptron(), loss)},
        policy_reward=lambda task_reward, learned, alpha: learned["f"],
        knows_task_reward=False,
        uses_curriculum=False,
    )
