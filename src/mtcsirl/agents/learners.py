"""The two SAC learners: this package's engine and the reference."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, TypeAlias

from mtcsirl.agents.sac import FusedSac
from mtcsirl.settings import SacSettings
from mtcsirl.worlds.environments import ACTION_SIZE, OBSERVATION_SIZE

if TYPE_CHECKING:
    from mtcsirl.agents.reference import ReferenceSac

Learner: TypeAlias = "FusedSac | ReferenceSac"


def make_learner(
    agents: int,
    settings: SacSettings,
    seeds: Sequence[int],
    *,
    observation_size: int = OBSERVATION_SIZE,
    action_size: int = ACTION_SIZE,
) -> Learner:
    """The learner that `sac.learner` names."""
    if settings.learner == "stable_baselines3":
        from mtcsirl.agents.reference import ReferenceSac

        return ReferenceSac(agents, settings, seeds=seeds, observation_size=observation_size, action_size=action_size)
    return FusedSac(agents, settings, seeds=seeds, observation_size=observation_size, action_size=action_size)
