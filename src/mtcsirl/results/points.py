"""``points.parquet`` of a score as evidence: single transitions that count alike."""

from collections.abc import Sequence
from pathlib import Path

import pandas as pd

from mtcsirl.files import storage

EPISODE = ["transitions", "agent", "episode"]


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
