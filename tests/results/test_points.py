"""Single transitions of a score as evidence."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from mtcsirl.errors import UserError
from mtcsirl.results.points import read_points

EVERY = 5


def kept(steps: int, episodes: int, high: float) -> pd.DataFrame:
    """Every fifth transition of ``episodes`` of so many steps; the first of each has the value ``high``, others 0."""
    step = np.tile(np.arange(steps), episodes)
    frame = pd.DataFrame(
        {
            "transitions": "sac",
            "agent": 0,
            "episode": np.repeat(np.arange(episodes), steps),
            "learned": np.where(step == 0, high, 0.0),
        }
    )
    return frame.iloc[::EVERY]


def test_the_first_transition_of_an_episode_weighs_no_more_than_others(tmp_path: Path) -> None:
    frame = kept(500, 2, high=1.0)
    frame.to_parquet(tmp_path / "points.parquet")
    assert frame["learned"].mean() == pytest.approx(EVERY / 500), "five times what it is among all"
    found = read_points(tmp_path / "points.parquet", ("learned",))
    assert len(found) == len(frame) - 2
    assert found["learned"].max() == 0.0


def test_an_episode_of_one_point_keeps_it(tmp_path: Path) -> None:
    kept(EVERY, 3, high=1.0).to_parquet(tmp_path / "points.parquet")
    assert read_points(tmp_path / "points.parquet", ("learned",))["episode"].tolist() == [0, 1, 2]


def test_episodes_of_other_agents_and_sets_are_others(tmp_path: Path) -> None:
    frame = kept(500, 1, high=1.0)
    parts = [frame, frame.assign(agent=1), frame.assign(transitions="expert")]
    pd.concat(parts).to_parquet(tmp_path / "points.parquet")
    assert len(read_points(tmp_path / "points.parquet", ("learned",))) == 3 * (len(frame) - 1)


def test_a_missing_column_is_named(tmp_path: Path) -> None:
    kept(500, 1, high=1.0).drop(columns="agent").to_parquet(tmp_path / "points.parquet")
    with pytest.raises(UserError, match="agent"):
        read_points(tmp_path / "points.parquet", ("learned",))
