"""A method of one's own, the extension of docs/extending.md, on demonstrations that exist already.

python examples/own_method.py --cs-reward velocity --seed 100 --output runs/mine --demonstrations FILE...
"""

import os
import sys

from torch import Tensor

from mtcsirl.cli import main
from mtcsirl.irl.discriminator import Method
from mtcsirl.irl.losses import Adversarial, interpolated_points
from mtcsirl.irl.methods import METHODS
from mtcsirl.irl.methods.base import Setup, penalised


def without_log_pi(f: Tensor, task_reward: Tensor, log_pi: Tensor, temperature: Tensor) -> Tensor:
    """log D - log(1 - D) = f(s, a, s'), GAIL's logit."""
    return f


def mt_gail(setup: Setup) -> Method:
    """A discriminator that all tasks share; generators get r_t + alpha f."""
    loss = penalised(Adversarial(without_log_pi), setup.irl.discriminator.gradient_penalty, interpolated_points)
    discriminators = {"f": setup.shared(setup.perceptron(), loss)}
    return Method(discriminators, lambda paid, learned, alpha: paid + alpha * learned["f"], True, True)


METHODS["mt_gail"] = mt_gail

if __name__ == "__main__":
    os.environ["MTCSIRL_EXTENSIONS"] = __file__  # so that the run's identity knows this file
    sys.exit(main(["learn-reward", "--method", "mt_gail", *sys.argv[1:]]))
