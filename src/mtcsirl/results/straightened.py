"""What is left of two rewards once any bend in the task reward is taken away, not only a straight line."""

import numpy as np
import pandas as pd

from mtcsirl.results.statistics import Array

TENTHS = np.linspace(0, 1, 11)
POWERS = np.arange(4)
NOTHING = 1e-3
"""Part of a reward's variance: with less than this left it is a function of r_task, and the rest is the fit's error."""


def within_tenths(points: pd.DataFrame) -> pd.DataFrame:
    """``points`` with ``learned`` and ``truth`` less a cubic in ``task_reward`` within each tenth of its values.

    The partial correlation takes one straight line away, so that a reward which is a bent function of r_task alone,
    such as -r_task^3, keeps some of it. Ten cubics follow any bend, but no jump within a tenth. They are fitted per
    seed, with every set of transitions as an equal part; ``task_reward`` becomes 0, for it is used up. A reward of
    which nothing is left but the error of the fit becomes 0 as well.

    Args:
        points: rows (seed, transitions, learned, truth, task_reward).
    """
    rest = pd.concat([_rest(part) for _, part in points.groupby("seed", sort=False)]).reindex(points.index)
    return points.assign(learned=rest["learned"], truth=rest["truth"], task_reward=0.0)


def _rest(part: pd.DataFrame) -> pd.DataFrame:
    t = part["task_reward"].to_numpy(dtype=float)
    both = part[["learned", "truth"]].to_numpy(dtype=float)
    weights = np.sqrt(1.0 / part.groupby("transitions")["transitions"].transform("size").to_numpy(dtype=float))
    edges = np.unique(np.quantile(t, TENTHS))
    place = np.searchsorted(edges[1:-1], t, side="right")
    rest = np.empty_like(both)
    for tenth in np.unique(place):
        own = place == tenth
        rest[own] = both[own] - _curve(t[own], both[own], weights[own])
    rest[:, rest.var(axis=0) <= NOTHING * both.var(axis=0)] = 0.0
    return pd.DataFrame(rest, index=part.index, columns=["learned", "truth"])


def _curve(t: Array, values: Array, weights: Array) -> Array:
    """The weighted least-squares cubic of ``values`` [points, 2] in ``t`` [points], at these points."""
    width = np.ptp(t) or 1.0
    design = ((t - t.mean()) / width)[:, None] ** POWERS
    found, *_ = np.linalg.lstsq(design * weights[:, None], values * weights[:, None], rcond=None)
    return np.asarray(design @ found)
