"""The ground-truth cs-reward of what an agent sees."""

from __future__ import annotations

from dataclasses import dataclass

from torch import Tensor

from mtcsirl.rewards.ground_truth import COMMON_SENSE_REWARDS, CommonSenseReward
from mtcsirl.transitions import Transitions
from mtcsirl.worlds.environments import OBSERVATION_MAPS, ObservationMap


@dataclass(frozen=True)
class GroundTruth:
    """A cs-reward [...] of transitions [...] as the agent sees them: the observation map is inverted first."""

    reward: CommonSenseReward
    seen: ObservationMap

    def __call__(self, transitions: Transitions) -> Tensor:
        """The reward [...]."""
        return self.reward(
            transitions._replace(
                observation=self.seen.invert(transitions.observation),
                next_observation=self.seen.invert(transitions.next_observation),
            )
        )


def ground_truth(cs_reward: str, observation: str) -> GroundTruth:
    """The ground-truth cs-reward of this name, seen through this observation map."""
    return GroundTruth(COMMON_SENSE_REWARDS[cs_reward], OBSERVATION_MAPS[observation])
