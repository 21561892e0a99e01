"""dm_control's reward shape for one number."""

from functools import cache
from typing import Any

import numpy as np
from metaworld.utils import reward_utils

_DOUBLES = frozenset({float, int, np.float64})


def tolerance(
    x: Any,
    bounds: tuple[Any, Any] = (0.0, 0.0),
    margin: Any = 0.0,
    sigmoid: Any = "gaussian",
    value_at_margin: float = 0.1,
) -> Any:
    """Return 1 inside the bounds, falling to ``value_at_margin`` at distance ``margin`` outside of them.

    Equal in every bit to ``metaworld.utils.reward_utils.tolerance``, which it calls for whatever is not a double with
    one of the two sigmoids that the tasks use: long_tail ``1 / ((d k)^2 + 1)`` and gaussian ``exp(-(d k)^2 / 2)``.
    """
    lower, upper = bounds
    plain = type(x) in _DOUBLES and type(lower) in _DOUBLES and type(upper) in _DOUBLES
    if not (plain and lower <= upper and margin > 0 and sigmoid in ("long_tail", "gaussian")):
        return reward_utils.tolerance(x, bounds, margin, sigmoid, value_at_margin)
    if lower <= x <= upper:
        return 1.0
    distance = float(lower - x if x < lower else x - upper) / float(margin)
    if sigmoid == "long_tail":
        return 1 / ((distance * _long_tail_scale(value_at_margin)) ** 2 + 1)
    # numpy's exp, not math's: the two differ in the last bit.
    return float(np.exp(-0.5 * (distance * _gaussian_scale(value_at_margin)) ** 2))


@cache
def _long_tail_scale(value_at_margin: float) -> float:
    return float(np.sqrt(1 / value_at_margin - 1))


@cache
def _gaussian_scale(value_at_margin: float) -> float:
    return float(np.sqrt(-2 * np.log(value_at_margin)))
