"""MT-VAIRL: MT-AIRL with a variational information bottleneck (Peng et al., 2018)."""

from mtcsirl.irl.discriminator import Method
from mtcsirl.irl.methods.base import Setup, bottlenecked


def mt_vairl(setup: Setup) -> Method:
    """Discriminators of equation 1 that share a bottlenecked f; generators get f alone."""
    return Method(
        discriminators={"f": setup.shared(setup.bottleneck(), bottlenecked(setup.irl.discriminator))},
        policy_reward=lambda task_reward, learned, alpha: learned["f"],
        knows_task_reward=False,
        uses_curriculum=False,
    )
