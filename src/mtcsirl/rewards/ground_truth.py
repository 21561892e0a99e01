"""The common-sense rewards that the experts are trained with and that every result is measured by.

The paper writes both as ``-C |value - target|`` (equations 10 and 11) and then states C_v = 0.8 and C_n = 3 without
targets. We read 0.8 and 3 as the targets, which its experts reach (0.81 and 2.95 in Table 2), and leave C at 1; the
weight beside the task reward is a setting of the expert.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

from mtcsirl.names import QUANTITIES
from mtcsirl.transitions import Transitions

if TYPE_CHECKING:
    from torch import Tensor

STEP_SECONDS = 0.0125
"""Time between two observations: 5 steps of the simulator of 0.0025 s each."""

_HAND, _PREVIOUS_HAND = slice(0, 3), slice(18, 21)


def velocity(transitions: Transitions) -> Tensor:
    """Return the speed of the end effector in m/s [...]: ``||l(s') - l(s)||_2 / dt`` with dt = 0.0125 s.

    The transitions are in raw units. Both positions are read from s', which holds the hand of this step and of the
    step before: taken from s and s' they would be rounded to float32 twice, once in each observation map inverted,
    and a position of 0.6 m is known to 6e-8 m only; and a transition whose s' alone is stored can be measured too.
    """
    after = transitions.next_observation
    metres: Tensor = (after[..., _HAND] - after[..., _PREVIOUS_HAND]).norm(dim=-1)
    return metres / STEP_SECONDS


def action_norm(transitions: Transitions) -> Tensor:
    """Return the L1 norm of the action [...], ``||a||_1``, in [0, 4]."""
    return transitions.action.abs().sum(dim=-1)


@dataclass(frozen=True)
class CommonSenseReward:
    """A common-sense reward ``r_CS(s, a, s') = -C |measure(s, a, s') - target|``: equations (10) and (11).

    A reward of one's own is one measuring function and one entry of ``COMMON_SENSE_REWARDS``.
    """

    name: str
    measure: Callable[[Transitions], Tensor]
    """Maps transitions [..., *] in raw units to the measured value [...]."""
    target: float
    unit: str
    """What stands beside its name on the axis of a figure."""
    weight: float = 1.0

    def __call__(self, transitions: Transitions) -> Tensor:
        """Return the reward [...] of transitions in raw units."""
        return -self.weight * (self.measure(transitions) - self.target).abs()


def _of_the_paper(name: str, measure: Callable[[Transitions], Tensor]) -> CommonSenseReward:
    _, unit, target = QUANTITIES[name]
    assert target is not None
    return CommonSenseReward(name, measure, target, unit)


COMMON_SENSE_REWARDS: dict[str, CommonSenseReward] = {
    "velocity": _of_the_paper("velocity", velocity),
    "action_norm": _of_the_paper("action_norm", action_norm),
}
"""Equation (10): ``-C_v | ||l(s') - l(s)||_2 - v_target |``. Equation (11): ``-C_n | ||a||_1 - n_target |``."""
