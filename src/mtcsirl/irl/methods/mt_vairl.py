"""MT-VAIRL: MT-AIRL with a variational information bottleneck (Peng et al., 2018)."""

from mtcsirl.irl.discriminator import Method
from mtcsirl.irl.losses import Adversarial, InformationBottleneck, entire_reward_logit
from mtcsirl.irl.methods.base import Setup
from mtcsirl.settings import DiscriminatorSettings


def bottlenecked(settings: DiscriminatorSettings) -> InformationBottleneck:
    """Equation 1's loss under the constraint KL <= I_c."""
    return InformationBottleneck(
        Adversarial(entire_reward_logit), settings.information_constraint, settings.initial_beta, settings.beta_step
    )


def mt_vairl(setup: Setup) -> Method:
    """Discriminators of equation 1 that share a bottlenecked f; generators get f alone."""
    return Method(
        name="mt_vairl",
        discriminators={"f": setup.shared(setup.bottleneck(), bottlenecked(setup.irl.discriminator))},
        policy_reward=lambda task_reward, learned, alpha: learned["f"],
        knows_task_reward=False,
        uses_curriculum=False,
    )
