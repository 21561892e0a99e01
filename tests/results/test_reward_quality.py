"""Correlations over seeds against the seeds' own."""

import numpy as np
import pandas as pd
import pytest
from scipy import stats

from mtcsirl.results.reward_quality import KEY, quality_markdown, reward_quality

NAMED = dict(zip(KEY, ("multi_task", "mt_csirl", "velocity", "all", "reach", "sac"), strict=True))


def _points(seeds: int, noise: float, episodes: int = 6, steps: int = 40) -> pd.DataFrame:
    random = np.random.default_rng(0)
    frames = []
    for seed in range(seeds):
        truth = random.normal(size=episodes * steps) + np.repeat(random.normal(size=episodes), steps)
        learned = 10.0**seed * (truth + noise * random.normal(size=len(truth))) + 100.0 * seed
        frames.append(
            pd.DataFrame(
                {"truth": truth, "learned": learned, "truth_rest": truth, "learned_rest": -learned, "seed": seed}
            ).assign(episode=np.repeat(np.arange(episodes), steps), **NAMED)
        )
    return pd.concat(frames, ignore_index=True)


def _scores(seeds: int) -> pd.DataFrame:
    rows = [{"seed": s, "reward": "learned", "statistic": "epic", "value": 0.1 + 0.1 * s} | NAMED for s in range(seeds)]
    return pd.DataFrame(rows)


@pytest.fixture
def rows() -> pd.DataFrame:
    return reward_quality(_points(3, 1.0), _scores(3), 200).set_index("statistic")


def test_the_correlation_over_seeds_is_the_mean_of_the_seeds_own(rows) -> None:
    groups = [group for _, group in _points(3, 1.0).groupby("seed")]
    own = [stats.pearsonr(group["learned"], group["truth"]).statistic for group in groups]
    ranks = [stats.spearmanr(group["learned"], group["truth"]).statistic for group in groups]
    assert rows.loc["pearson", "value"] == pytest.approx(np.mean(own))
    assert rows.loc["spearman", "value"] == pytest.approx(np.mean(ranks))
    assert rows.loc["pearson_residual", "value"] == pytest.approx(-np.mean(own))


def test_scales_of_seeds_do_not_matter_and_intervals_hold_the_value(rows) -> None:
    assert rows.loc["pearson", "value"] > 0.6
    for name in ("pearson", "spearman", "pearson_residual"):
        assert rows.loc[name, "low"] < rows.loc[name, "value"] < rows.loc[name, "high"]
    assert (rows["seeds"] == 3).all()
    assert (rows["episodes"] == 18).all()


def test_epic_is_averaged_over_seeds(rows) -> None:
    assert rows.loc["epic", "value"] == pytest.approx(0.2)
    assert rows.loc["epic", "low"] < 0.2 < rows.loc["epic", "high"]


def test_clusters_widen_the_interval() -> None:
    """40 rows that are copies of one another are one observation, not 40."""
    points = _points(2, 1.0, episodes=8, steps=1)
    copied = points.loc[points.index.repeat(40)].reset_index(drop=True)
    one, many = (reward_quality(frame, _scores(2), 300).set_index("statistic") for frame in (points, copied))
    assert many.loc["pearson", "low"] == pytest.approx(one.loc["pearson", "low"], abs=0.02)


def test_a_reward_that_does_not_vary_has_none_and_the_table_says_so() -> None:
    points = _points(2, 1.0).assign(learned=3.0)
    rows = reward_quality(points, _scores(2), 20)
    assert np.isnan(rows.set_index("statistic").loc["pearson", "value"])
    assert "| nan [nan, nan] |" in quality_markdown(rows)
