"""What a figure of results is drawn from."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import pandas as pd

from mtcsirl.names import CS_REWARDS
from mtcsirl.settings import Settings

CURVE_COLUMNS = (
    "stage", "experiment", "method", "cs_reward", "source", "task", "target", "seed", "step", "metric", "value",
)  # fmt: skip
SCORE_COLUMNS = (
    "experiment", "method", "cs_reward", "source", "seed", "transitions", "reward", "statistic",
    "value", "low", "high", "n",
)  # fmt: skip
POINT_COLUMNS = (
    "experiment", "method", "cs_reward", "source", "seed", "transitions", "episode", "truth", "learned", "task_reward",
)  # fmt: skip


def _empty(columns: tuple[str, ...]) -> pd.DataFrame:
    return pd.DataFrame({name: [] for name in columns})


@dataclass(frozen=True, kw_only=True)
class FigureData:
    """Tidy frames of all runs that are there (columns above) and the settings that say which should be.

    ``curves``: one row per run, step and metric; ``scores``: correlations of learned and true cs-reward;
    ``points``: single transitions of those correlations.
    """

    settings: Settings
    curves: pd.DataFrame = field(default_factory=lambda: _empty(CURVE_COLUMNS))
    scores: pd.DataFrame = field(default_factory=lambda: _empty(SCORE_COLUMNS))
    points: pd.DataFrame = field(default_factory=lambda: _empty(POINT_COLUMNS))

    @property
    def cs_rewards(self) -> list[str]:
        """The study's cs-rewards in the paper's order of panels: action norm, velocity, then any others."""
        known = [name for name in reversed(CS_REWARDS) if name in self.settings.cs_rewards]
        return known + [name for name in self.settings.cs_rewards if name not in CS_REWARDS]


def rows_where(frame: pd.DataFrame, wanted: Mapping[str, Any]) -> pd.DataFrame:
    """Rows whose columns have the wanted values; a tuple or list means any of its values."""
    for column, value in wanted.items():
        keep = frame[column].isin(value) if isinstance(value, tuple | list) else frame[column] == value
        frame = frame[keep]
    return frame
