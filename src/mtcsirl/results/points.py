"""``points.parquet`` of a score as evidence: single transitions that count alike."""

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
import pandas as pd

from mtcsirl.files import storage

POLICIES = ("sac", "expert", "generator", "uniform")
"""The sets of transitions that are the equal parts of ``across``."""
EPISODE = ["transitions", "agent", "episode"]
REWARDS = ["learned", "truth", "task_reward"]


def read_points(path: Path | str, columns: Sequence[str]) -> pd.DataFrame:
    """The evenly spaced transitions of a score with ``columns``, but for the first of each episode.

    Every fifth or twentieth transition is kept, and an episode has 500: so every episode's first is, where one of five
    or twenty others is. Nothing moves there yet, and learned rewards are high: counted as often as the others' spacing
    has it, it would weigh five or twenty times as much as it does among all. An episode of a single point keeps it.

    Raises:
        UserError: the file is missing or unreadable, or lacks a column.
    """
    return without_first(storage.read_parquet(path, tuple(dict.fromkeys((*columns, *EPISODE)))))


def without_first(points: pd.DataFrame, episode: list[str] = EPISODE) -> pd.DataFrame:
    """``points`` without the first of each episode, which the columns ``episode`` name together."""
    first, more = ~points.duplicated(episode), points.duplicated(episode, keep=False)
    return points[~(first & more)]


def usable(points: pd.DataFrame) -> tuple[pd.DataFrame, tuple[str, ...]]:
    """The points of IRL seeds that can be judged, and why the others cannot.

    A seed needs every set of transitions and numbers throughout, and points that are not another seed's.
    """
    if not len(points):
        return points, ()
    kept: dict[int, pd.DataFrame] = {}
    why: list[str] = []
    for seed, own in points.groupby("seed", sort=True):
        fault = _fault(own, kept)
        if fault:
            why.append(f"IRL seed {seed} left out: {fault}")
        else:
            kept[int(str(seed))] = own
    return points[points["seed"].isin(list(kept))], tuple(why)


def _fault(own: pd.DataFrame, before: Mapping[int, pd.DataFrame]) -> str:
    values = own[REWARDS].to_numpy(dtype=float)
    bad = [name for name, known in zip(REWARDS, np.isfinite(values).all(axis=0), strict=True) if not known]
    lost = [name for name in POLICIES if name not in set(own["transitions"])]
    twin = [seed for seed, other in before.items() if np.array_equal(values, other[REWARDS].to_numpy(dtype=float))]
    if bad:
        return f"not all of its {', '.join(bad)} are numbers"
    if lost:
        return f"no transitions of {', '.join(lost)}"
    return f"its points are those of seed {twin[0]}" if twin else ""
