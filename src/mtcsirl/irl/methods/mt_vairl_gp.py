"""MT-VAIRL-GP: MT-VAIRL with a zero-centred gradient penalty on expert samples (Peng et al., 2018)."""

from mtcsirl.irl.discriminator import Method
from mtcsirl.irl.losses import expert_points
from mtcsirl.irl.methods.base import Setup, bottlenecked, penalised


def mt_vairl_gp(setup: Setup) -> Method:
    """MT-VAIRL whose loss adds w / 2 E_D ||grad f||^2, the factor 1/2 as in the authors' code."""
    settings = setup.irl.discriminator
    loss = penalised(bottlenecked(settings), settings.vairl_gradient_penalty / 2, expert_points)
    return Method(
        discriminators={"f": setup.shared(setup.bottleneck(), loss)},
        policy_reward=lambda task_reward, learned, alpha: learned["f"],
        knows_task_reward=False,
        uses_curriculum=False,
    )
