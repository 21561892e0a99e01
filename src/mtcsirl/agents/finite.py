"""Numbers that are not finite end a run before a checkpoint, a policy or a row is made of them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from torch import Tensor

from mtcsirl.errors import UserError
from mtcsirl.settings import DiscriminatorSettings, SacSettings


class NotFiniteError(UserError):
    """What became non-finite, where, with which settings; `agents` are the places of those concerned in their batch."""

    def __init__(self, message: str, agents: Sequence[int] = ()) -> None:
        super().__init__(message)
        self.agents = tuple(agents)


def broken_rows(values: np.ndarray) -> list[int]:
    """The indices of rows of ``values`` [A, ...] that hold a number that is not finite."""
    finite = np.isfinite(values)
    if finite.all():
        return []
    return np.flatnonzero(~finite.reshape(len(values), -1).all(axis=1)).tolist()


def broken_agents(parts: Mapping[str, Tensor]) -> dict[int, str]:
    """Which of A agents hold a number that is not finite, and the name of the first of ``parts`` [A, n] that does."""
    found: dict[int, str] = {}
    for name, values in parts.items():
        # A sum of finite numbers may overflow in float32, so it only says where to look closer.
        if not values.sum().isfinite():
            for agent in (~values.isfinite().all(dim=1)).nonzero().flatten().tolist():
                found.setdefault(agent, name)
    return found


def sac_settings(sac: SacSettings) -> str:
    """The settings that make numbers grow, for a line to the user."""
    names = ("policy_learning_rate", "critic_learning_rate", "temperature_learning_rate", "reward_scale")
    return ", ".join(f"sac.{name} {getattr(sac, name):g}" for name in names)


def discriminator_settings(discriminator: DiscriminatorSettings) -> str:
    """The same of a discriminator."""
    names = ("learning_rate", "output_scale", "gradient_penalty")
    return ", ".join(f"irl.discriminator.{name} {getattr(discriminator, name):g}" for name in names)
