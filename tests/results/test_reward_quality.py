"""Correlations over seeds against the seeds' own."""

import numpy as np
import pandas as pd
import pytest
from scipy import stats

from mtcsirl.results.correlation import partial_correlation, pearson
from mtcsirl.results.reward_quality import KEY, quality_markdown, read_quality, reward_quality

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
            ).assign(
                task_reward=0.5 * truth + random.normal(size=len(truth)),
                agent=np.repeat(np.arange(episodes) % 2, steps),
                episode=np.repeat(np.arange(episodes), steps),
                **NAMED,
            )
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


def test_partial_and_gain_are_means_of_the_seeds_own(rows) -> None:
    columns = ("learned", "truth", "task_reward")
    seeds = [[group[name].to_numpy() for name in columns] for _, group in _points(3, 1.0).groupby("seed")]
    own = [partial_correlation(*vectors) for vectors in seeds]
    assert rows.loc["partial", "value"] == pytest.approx(np.mean(own))
    assert rows.loc["gain", "value"] == pytest.approx(np.mean([pearson(f, c) - pearson(-t, c) for f, c, t in seeds]))


def test_a_reward_that_repeats_the_task_gains_nothing_beyond_it() -> None:
    points = _points(3, 1.0)
    told = reward_quality(points.assign(learned=-2 * points["task_reward"]), _scores(3), 100).set_index("statistic")
    assert np.isnan(told.loc["partial", "value"])
    assert told.loc["gain", "value"] == pytest.approx(0.0, abs=1e-9)
    mixed = points.assign(learned=-5 * points["task_reward"] + 0.1 * points["truth"].to_numpy()[::-1])
    mixed = reward_quality(mixed, _scores(3), 200).set_index("statistic")
    assert abs(mixed.loc["pearson", "value"]) > 0.3
    assert mixed.loc["partial", "low"] < 0 < mixed.loc["partial", "high"]


def test_order_of_rows_does_not_matter(rows) -> None:
    shuffled = _points(3, 1.0).sample(frac=1.0, random_state=0)
    again = reward_quality(shuffled, _scores(3), 10).set_index("statistic")
    assert again["value"].to_numpy() == pytest.approx(rows["value"].to_numpy())


def test_agents_are_clusters_within_seeds() -> None:
    """Twelve episodes of two agents that differ are two observations, not twelve."""
    points = _points(2, 0.5, episodes=12, steps=5)
    points["learned"] += 10.0 ** points["seed"] * 6 * points["agent"]
    alone = points.assign(agent=points["episode"])
    wide, narrow = (reward_quality(frame, _scores(2), 400).set_index("statistic") for frame in (points, alone))
    width = [frame.loc["pearson", "high"] - frame.loc["pearson", "low"] for frame in (wide, narrow)]
    assert width[0] > 1.2 * width[1]


def test_nothing_scored_is_an_empty_table(tmp_path) -> None:
    rows = read_quality([], tmp_path, 10)
    assert rows.empty
    assert "No reward was scored yet." in quality_markdown(rows)


def test_scales_of_seeds_do_not_matter_and_intervals_hold_the_value(rows) -> None:
    assert rows.loc["pearson", "value"] > 0.6
    for name in ("pearson", "spearman", "pearson_residual"):
        assert rows.loc[name, "low"] < rows.loc[name, "value"] < rows.loc[name, "high"]
    assert (rows["seeds"] == 3).all()
    assert (rows["agents"] == 6).all()
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
