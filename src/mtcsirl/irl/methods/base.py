"""What the methods are composed from, sized by the settings."""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import torch

from mtcsirl.irl.discriminator import Discriminator
from mtcsirl.irl.losses import (
    Adversarial,
    InformationBottleneck,
    PenaltyPoints,
    entire_reward_logit,
    gradient_penalty_at,
)
from mtcsirl.rewards.networks import RewardNetwork
from mtcsirl.settings import DiscriminatorSettings, IrlSettings


@dataclass(frozen=True)
class Setup:
    """What a method is built for."""

    irl: IrlSettings
    tasks: int
    """T."""
    seed: int
    discount: float = 0.99
    observation_size: int = 39
    action_size: int = 4
    device: torch.device | str = "cpu"

    def perceptron(self) -> dict[str, Any]:
        """The architecture of f: a ReLU perceptron."""
        return self._architecture("perceptron", self.irl.discriminator.hidden_sizes)

    def bottleneck(self) -> dict[str, Any]:
        """The architecture of VAIRL's f: encoder, z, linear."""
        sizes = self.irl.discriminator
        return self._architecture("bottleneck", sizes.bottleneck_hidden_sizes, bottleneck_size=sizes.bottleneck_size)

    def _architecture(self, kind: str, hidden_sizes: tuple[int, ...], **extra: Any) -> dict[str, Any]:
        return {
            "kind": kind,
            "observation_size": self.observation_size,
            "action_size": self.action_size,
            "hidden_sizes": list(hidden_sizes),
            "output_scale": self.irl.discriminator.output_scale,
            "shaping": self.irl.discriminator.shaping,
            "discount": self.discount,
            **extra,
        }

    def shared(self, architecture: dict[str, Any], loss: Adversarial) -> Discriminator:
        """A discriminator whose reward all tasks share."""
        return self._discriminator(architecture, loss, rewards=1, stream=0)

    def per_task(self, architecture: dict[str, Any], loss: Adversarial) -> Discriminator:
        """A discriminator with T rewards, one per task."""
        return self._discriminator(architecture, loss, rewards=self.tasks, stream=1)

    def _discriminator(
        self, architecture: dict[str, Any], loss: Adversarial, rewards: int, stream: int
    ) -> Discriminator:
        weights, noise = np.random.SeedSequence((self.seed, stream)).generate_state(2)
        network = RewardNetwork(architecture, rewards, torch.Generator().manual_seed(int(weights)), self.device)
        random = torch.Generator(self.device).manual_seed(int(noise))
        return Discriminator(network, loss, self.irl.discriminator.learning_rate, random)


def penalised(loss: Adversarial, weight: float, points: PenaltyPoints) -> Adversarial:
    """``loss`` with a gradient penalty, or as it is where the weight is 0."""
    return replace(loss, penalties=(*loss.penalties, gradient_penalty_at(points, weight))) if weight > 0 else loss


def bottlenecked(settings: DiscriminatorSettings) -> Adversarial:
    """Equation 1's loss under VAIRL's constraint KL <= I_c."""
    constraint = InformationBottleneck(settings.information_constraint, settings.initial_beta, settings.beta_step)
    return Adversarial(entire_reward_logit, bottleneck=constraint)
