import json
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy import stats

from mtcsirl.results.statistics import (
    Summary,
    cluster_bootstrap,
    hedges_g,
    interquartile_mean,
    mean_correlation,
    prediction_interval,
    probability_of_improvement,
    stratified_bootstrap,
    summarise,
    t_interval,
    welch,
)

RLIABLE = json.loads((Path(__file__).parents[1] / "data" / "rliable.json").read_text())
DATA = {name: np.array(values) for name, values in RLIABLE["data"].items()}
settings.register_profile("busy", max_examples=40, deadline=None, suppress_health_check=[HealthCheck.too_slow])
settings.load_profile("busy")  # a busy machine is no reason to fail
numbers = st.floats(-1e3, 1e3, allow_nan=False).map(lambda x: round(x, 3))
seeds = st.lists(numbers, min_size=2, max_size=9)
matrices = st.integers(1, 4).flatmap(
    lambda tasks: arrays(float, st.tuples(st.integers(2, 6), st.just(tasks)), elements=numbers)
)


# --- against other implementations ---


def test_equals_rliable_on_fixed_data():
    assert np.mean(DATA["first"]) == pytest.approx(RLIABLE["mean"], abs=1e-12)
    assert interquartile_mean(DATA["first"]) == pytest.approx(RLIABLE["iqm"], abs=1e-12)
    assert interquartile_mean(DATA["second"]) == pytest.approx(RLIABLE["iqm_second"], abs=1e-12)
    improvement = probability_of_improvement(DATA["first"], DATA["second"])
    assert improvement == pytest.approx(RLIABLE["probability_of_improvement"], abs=1e-12)
    tied = probability_of_improvement(DATA["tied"], DATA["shifted"])
    assert tied == pytest.approx(RLIABLE["probability_of_improvement_tied"], abs=1e-12)


@pytest.mark.parametrize(
    ("names", "statistic", "key"),
    [
        (["first"], np.nanmean, "mean_interval"),
        (["first"], interquartile_mean, "iqm_interval"),
        (["first", "second"], probability_of_improvement, "probability_of_improvement_interval"),
    ],
)
def test_bootstrap_intervals_agree_with_rliable(names, statistic, key):
    estimate = stratified_bootstrap([DATA[name] for name in names], statistic, np.random.default_rng(0))
    width = RLIABLE[key][1] - RLIABLE[key][0]
    assert estimate[1:3] == pytest.approx(RLIABLE[key], abs=0.06 * width)


@given(seeds, seeds)
def test_welch_equals_scipy(a, b):
    if min(np.std(a), np.std(b)) < 1e-6:
        return
    ours, theirs = welch(summarise(a), summarise(b)), stats.ttest_ind(a, b, equal_var=False)
    interval = theirs.confidence_interval()
    assert ours.p == pytest.approx(theirs.pvalue, abs=1e-9)
    assert (ours.low, ours.high) == pytest.approx((interval.low, interval.high), rel=1e-6, abs=1e-6)


@given(seeds)
def test_interquartile_mean_equals_scipy(values):
    assert interquartile_mean(values) == pytest.approx(stats.trim_mean(values, 0.25), rel=1e-9, abs=1e-9)


@given(seeds)
def test_t_interval_equals_scipy(values):
    summary = summarise(values)
    if summary.std > 1e-9:
        expected = stats.t.interval(0.95, len(values) - 1, np.mean(values), stats.sem(values))
        assert t_interval(summary) == pytest.approx(expected, abs=1e-6)


# --- numbers worked out elsewhere ---


@pytest.mark.parametrize(
    ("mean", "std", "expected"),
    [(2.75, 0.18, (2.43, 3.07)), (0.73, 0.07, (0.61, 0.85)), (2.70, 0.35, (2.09, 3.31)), (1.57, 0.48, (0.73, 2.41))],
)
def test_prediction_intervals_of_the_paper(mean, std, expected):
    assert prediction_interval(Summary(mean, std, 5), 5) == pytest.approx(expected, abs=0.006)


def test_prediction_interval_covers_a_perfect_replication_95_percent():
    generator = np.random.default_rng(3)
    samples = generator.normal(size=(4000, 10))
    inside = [prediction_interval(summarise(row[:5]), 5).contains(row[5:].mean()) for row in samples]
    assert np.mean(inside) == pytest.approx(0.95, abs=0.015)


def test_t_interval_covers_at_five_seeds():
    samples = np.random.default_rng(4).normal(size=(4000, 5))
    assert np.mean([t_interval(summarise(row)).contains(0.0) for row in samples]) == pytest.approx(0.95, abs=0.015)


def test_hedges_g_by_hand_and_its_coverage():
    g = hedges_g(Summary(3.0, 1.0, 5), Summary(1.0, 1.0, 5))
    assert g.value == pytest.approx(2.0 * (1 - 3 / 31))
    assert g.n == 10
    generator = np.random.default_rng(5)
    first, second = generator.normal(1.0, 1.0, (300, 5)), generator.normal(0.0, 1.0, (300, 5))
    estimates = [hedges_g(summarise(a), summarise(b)) for a, b in zip(first, second, strict=True)]
    correction = 1 - 3 / 31
    assert np.mean([e.low <= correction <= e.high for e in estimates]) == pytest.approx(0.95, abs=0.04)
    assert np.mean([e.value for e in estimates]) == pytest.approx(1.0, abs=0.12)


def test_hedges_g_without_spread():
    assert hedges_g(Summary(1.0, 0.0, 5), Summary(1.0, 0.0, 5)).value == 0
    assert hedges_g(Summary(2.0, 0.0, 5), Summary(1.0, 0.0, 5)).value == np.inf


def test_too_few_values_have_no_spread():
    summary = summarise([0.7, np.nan])
    assert (summary.mean, summary.n) == (0.7, 1)
    assert np.isnan([summary.std, *t_interval(summary), *prediction_interval(summary, 5)]).all()
    assert not t_interval(summary).contains(0.7)
    assert np.isnan(summarise([]).mean)


def test_superiority_counts_wins_and_half_of_ties():
    assert probability_of_improvement([[1.0], [2.0]], [[1.0], [0.0]]) == pytest.approx((0.5 + 1 + 1 + 1) / 4)
    with pytest.raises(ValueError, match="same tasks"):
        probability_of_improvement([[1.0, 2.0]], [[1.0]])


def test_mean_correlation_works_on_the_z_scale():
    estimate = mean_correlation([0.9, 0.5])
    assert estimate.value == pytest.approx(np.tanh((np.arctanh(0.9) + np.arctanh(0.5)) / 2))
    assert estimate.n == 2
    assert mean_correlation([1.0, 1.0, 1.0]).value == pytest.approx(1.0)


# --- properties: order, units, duplicates, missing seeds ---


@given(matrices, st.randoms(use_true_random=False))
def test_order_of_runs_does_not_matter(matrix, shuffler):
    order = list(range(len(matrix)))
    shuffler.shuffle(order)
    assert interquartile_mean(matrix[order]) == pytest.approx(interquartile_mean(matrix), abs=1e-9)
    assert probability_of_improvement(matrix[order], matrix) == pytest.approx(0.5)
    assert summarise(matrix[order, 0]) == pytest.approx(summarise(matrix[:, 0]), abs=1e-9)


@given(seeds, seeds, st.floats(0.01, 100))
def test_units_do_not_matter(a, b, unit):
    first, second = summarise(a), summarise(b)
    scaled = [summarise(unit * np.array(values)) for values in (a, b)]
    if first.std + second.std < 1e-6:
        return
    assert hedges_g(*scaled).value == pytest.approx(hedges_g(first, second).value, rel=1e-6, abs=1e-9)
    assert welch(*scaled).p == pytest.approx(welch(first, second).p, rel=1e-6, abs=1e-9)
    wide, narrow = t_interval(scaled[0]), t_interval(first)
    assert wide.high - wide.low == pytest.approx(unit * (narrow.high - narrow.low), rel=1e-6, abs=1e-9)


@given(seeds, seeds)
def test_swapping_the_groups_flips_the_sign(a, b):
    first, second = summarise(a), summarise(b)
    forth, back = hedges_g(first, second), hedges_g(second, first)
    assert forth.value == pytest.approx(-back.value, nan_ok=True)
    if np.isfinite(forth.low) and abs(forth.value) < 5:
        assert (forth.low, forth.high) == pytest.approx((-back.high, -back.low), rel=1e-4, abs=1e-4)
    forth_p, back_p = (probability_of_improvement(np.c_[x], np.c_[y]) for x, y in ((a, b), (b, a)))
    assert forth_p + back_p == pytest.approx(1.0)


@given(matrices)
def test_duplicated_runs_move_no_point_estimate(matrix):
    twice = np.concatenate([matrix, matrix])
    assert summarise(twice[:, 0]).mean == pytest.approx(summarise(matrix[:, 0]).mean, abs=1e-9)
    assert summarise(twice[:, 0]).n == 2 * len(matrix), "n shows them"
    assert probability_of_improvement(twice, matrix) == pytest.approx(0.5)


@given(seeds, st.integers(0, 3))
def test_missing_seeds_only_lower_n(values, missing):
    padded = [*values, *[np.nan] * missing]
    assert summarise(padded) == pytest.approx(summarise(values))
    assert interquartile_mean(np.c_[padded]) == interquartile_mean(np.c_[values])


@settings(max_examples=20, deadline=None)
@given(matrices)
def test_bootstrap_brackets_its_estimate_and_repeats(matrix):
    draw = [
        stratified_bootstrap([matrix], np.nanmean, np.random.default_rng(7), resamples=50, confidence=1.0)
        for _ in range(2)
    ]
    assert draw[0] == draw[1], "the generator decides everything"
    assert matrix.min() - 1e-9 <= draw[0].low <= draw[0].high <= matrix.max() + 1e-9


def test_bootstrap_of_a_missing_task_is_unknown():
    estimate = stratified_bootstrap([[[1.0, np.nan], [2.0, np.nan]]], np.nanmean, np.random.default_rng(0))
    assert np.isnan(estimate.value)
    assert estimate.n == 2


def test_cluster_bootstrap_sees_through_repeated_rows():
    generator = np.random.default_rng(8)
    x, y = generator.normal(size=(2, 20))
    rows, episodes = np.repeat([x, y], 50, axis=1), np.repeat(np.arange(20), 50)

    def correlation(index):
        return float(np.corrcoef(rows[0, index], rows[1, index])[0, 1])

    clustered = cluster_bootstrap(correlation, [episodes], np.random.default_rng(9), resamples=400)
    naive = cluster_bootstrap(correlation, [np.arange(1000)], np.random.default_rng(9), resamples=400)
    assert clustered.n == 20
    assert clustered.high - clustered.low > 4 * (naive.high - naive.low)
    expected = stats.pearsonr(x, y).confidence_interval()
    assert (clustered.low, clustered.high) == pytest.approx(tuple(expected), abs=0.15)


def test_cluster_bootstrap_draws_seeds_before_episodes():
    """All spread lies between the two seeds, so every draw of episodes within a seed gives one of three means."""
    values, seed = np.array([0.0] * 6 + [1.0] * 6), np.repeat([0, 1], 6)
    episode = np.tile(np.repeat([0, 1, 2], 2), 2)
    draws: list[float] = []

    def mean(index):
        draws.append(float(values[index].mean()))
        return draws[-1]

    estimate = cluster_bootstrap(mean, [seed, episode], np.random.default_rng(0), resamples=100)
    assert set(draws) == {0.0, 0.5, 1.0}
    assert estimate.n == 6


@pytest.mark.parametrize("wild", [Summary(1.0, np.inf, 5), Summary(1e300, 1e299, 5), Summary(np.nan, np.nan, 5)])
def test_what_is_no_number_has_no_effect_and_no_test(wild):
    assert np.isnan(hedges_g(wild, Summary(1.0, 0.1, 5)).value)
    assert np.isnan(welch(wild, Summary(1.0, 0.1, 5)).low)


def test_equal_values_have_no_spread_but_that_of_floating_point():
    assert hedges_g(summarise([0.948] * 5), summarise([0.875] * 5)).value == np.inf
