"""Scatter and its correlation against known answers."""

import numpy as np
import pandas as pd
import pytest

from mtcsirl.figures.data import FigureData
from mtcsirl.figures.scatter import (
    SHOWN_POINTS,
    correlation_words,
    draw_scatter,
    scatter_caption,
    select_correlation,
    standardise,
)
from mtcsirl.figures.style import new_figure
from mtcsirl.results.statistics import Estimate

KEY = {"experiment": "single_target", "method": "mt_csirl", "cs_reward": "velocity", "source": "reach-wall"}
TASK = {"task": "reach-wall"}


def score(seed: int, value: float, **changes) -> dict:
    row = KEY | {"seed": seed, "transitions": "sac", "reward": "learned", "statistic": "pearson"}
    return row | {"value": value, "low": value - 0.1, "high": value + 0.1, "n": 9} | changes


def points(seed: int, truth, learned, transitions="sac") -> pd.DataFrame:
    return pd.DataFrame(
        KEY
        | {
            "seed": seed,
            "transitions": transitions,
            "episode": 0,
            "truth": truth,
            "learned": learned,
            "task_reward": 0.0,
        }
    )


def test_correlation_is_averaged_on_fishers_scale(settings):
    scores = pd.DataFrame(
        [score(0, 0.2), score(1, 0.8), score(2, 0.9, transitions="expert"), score(3, 0.9, reward="zero")]
    )
    found = select_correlation(FigureData(settings=settings, scores=scores), **KEY, **TASK)
    assert found.estimate.value == pytest.approx(np.tanh((np.arctanh(0.2) + np.arctanh(0.8)) / 2))
    assert found.estimate.n == 2


def test_one_seed_keeps_its_own_interval(settings):
    found = select_correlation(FigureData(settings=settings, scores=pd.DataFrame([score(0, 0.5)])), **KEY, **TASK)
    assert found.estimate == Estimate(0.5, 0.4, 0.6, 1)
    assert found.words() == "r = 0.50 [0.40, 0.60]"


def test_only_points_of_the_chosen_set_and_reward(settings):
    frame = pd.concat([points(0, [0.0, 1.0], [0.0, 1.0]), points(0, [5.0], [5.0], "expert")])
    found = select_correlation(FigureData(settings=settings, points=frame), **KEY, **TASK)
    assert found.points["truth"].tolist() == [0.0, 1.0]
    assert select_correlation(
        FigureData(settings=settings, points=frame), **KEY | TASK | {"method": "mt_airl"}
    ).points.empty


def test_standardised_within_each_seed():
    frame = pd.concat([points(0, [0, 1, 2], [10.0, 20.0, 30.0]), points(1, [0, 1, 2], [-1.0, -1.0, -1.0])])
    learned = standardise(frame)["learned"].tolist()
    assert learned == pytest.approx([-np.sqrt(1.5), 0, np.sqrt(1.5), 0, 0, 0])


def test_fitted_line_follows_the_points(settings):
    truth = np.linspace(-1, 0, 50)
    found = select_correlation(FigureData(settings=settings, points=points(0, truth, 3 * truth + 7)), **KEY, **TASK)
    axes = new_figure(2, 2).subplots()
    draw_scatter(axes, found, "mt_csirl", "velocity")
    slope = np.diff(axes.lines[0].get_ydata()) / np.diff(axes.lines[0].get_xdata())
    assert slope == pytest.approx(1 / truth.std())


@pytest.mark.parametrize("share", [0.33, 0.5])
def test_the_words_cover_no_points(settings, share):
    truth = np.linspace(-1, 0, 50)
    found = select_correlation(FigureData(settings=settings, points=points(0, truth, truth)), **KEY, **TASK)
    axes = new_figure(2, 2).subplots()
    draw_scatter(axes, found, "mt_csirl", "velocity", words_share=share)
    highest = axes.collections[0].get_offsets()[:, 1].max()
    low, high = axes.get_ylim()
    assert highest < low + (1 - share) * (high - low)


def test_few_points_are_drawn_of_many(settings):
    found = select_correlation(
        FigureData(settings=settings, points=points(0, np.arange(9_000.0), np.arange(9_000.0))), **KEY, **TASK
    )
    axes = new_figure(2, 2).subplots()
    draw_scatter(axes, found, "mt_csirl", "velocity")
    assert len(axes.collections[0].get_offsets()) == SHOWN_POINTS
    assert "9,000 transitions" in scatter_caption(found, "velocity")


def test_paper_stands_beside_ours(settings):
    data = FigureData(settings=settings, scores=pd.DataFrame([score(0, 0.5)]))
    assert "r = 0.50 [0.40, 0.60] (paper: 0.18)" in scatter_caption(select_correlation(data, **KEY, **TASK), "velocity")
    unknown = select_correlation(data, **KEY | TASK | {"cs_reward": "action_norm"})
    assert "paper" not in scatter_caption(unknown, "action_norm")
    axes = new_figure(2, 2).subplots()
    drawn = FigureData(settings=settings, scores=data.scores, points=points(0, [0.0, 1.0], [0.0, 1.0]))
    draw_scatter(axes, select_correlation(drawn, **KEY, **TASK), "mt_csirl", "velocity")
    assert axes.texts[0].get_text().endswith("paper: r = 0.18\nplain SAC transitions\nreach-wall, n = 1 seed")
    assert "m/s" in axes.get_xlabel()


def test_the_correlation_given_the_task_reward_stands_below_r(settings):
    scores = pd.DataFrame([score(seed, value) for seed, value in enumerate((0.7, 0.8))])
    given = pd.DataFrame([score(seed, value, statistic="partial") for seed, value in enumerate((0.1, 0.3))])
    data = FigureData(settings=settings, scores=pd.concat([scores, given]), points=points(0, [0.0, 1.0], [0.0, 1.0]))
    found = select_correlation(data, **KEY, **TASK)
    assert found.partial.value == pytest.approx(np.tanh((np.arctanh(0.1) + np.arctanh(0.3)) / 2))
    assert found.partial_words().startswith("given r_task: 0.20 [")
    assert found.partial_words() in scatter_caption(found, "velocity")
    axes = new_figure(2, 2).subplots()
    draw_scatter(axes, found, "mt_csirl", "velocity")
    assert axes.texts[0].get_text().splitlines()[:2] == [found.words(), found.partial_words()]


def test_words_without_interval_or_value():
    assert correlation_words(Estimate(0.18, np.nan, np.nan, 1)) == "r = 0.18"
    assert correlation_words(Estimate(np.nan, np.nan, np.nan, 0)) == "r undefined"
