"""MT-CSIRL: Algorithm 1, the paper's method with known task rewards."""

from mtcsirl.irl.discriminator import Method
from mtcsirl.irl.losses import Adversarial, interpolated_points, known_task_reward_logit
from mtcsirl.irl.methods.base import Setup, penalised
from mtcsirl.rewards.mixture import mixed


def mt_csirl(setup: Setup) -> Method:
    """Discriminators of equation 6 that share f; generators get r_t + alpha f (section 3.3)."""
    loss = penalised(
        Adversarial(known_task_reward_logit), setup.irl.discriminator.gradient_penalty, interpolated_points
    )
    return Method(
        discriminators={"f": setup.shared(setup.perceptron(), loss)},
        policy_reward=lambda task_reward, learned, alpha: mixed(task_reward, learned["f"], alpha),
        knows_task_reward=True,
        uses_curriculum=True,
    )
