"""Contrasts, equivalence, ratios and spreads, held against statsmodels and pingouin and against simulated studies."""

import numpy as np
import pingouin
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import stats
from statsmodels.stats.weightstats import CompareMeans, DescrStatsW, ttost_ind

from mtcsirl.results.contrasts import equivalence_power, fieller, nearness, spread_ratio
from mtcsirl.results.statistics import ONE_SIDED, Summary, contrast, summarise, welch

settings.register_profile("busy", max_examples=40, deadline=None)
settings.load_profile("busy")
FIRST = np.array([0.31, 0.36, 0.29, 0.40, 0.33])
SECOND = np.array([0.28, 0.35, 0.45, 0.31, 0.22, 0.30])
samples = st.lists(st.floats(-10, 10).map(lambda x: round(x, 2)), min_size=3, max_size=8).filter(
    lambda values: np.std(values) > 0.05
)


# --- against other implementations ---


@given(samples, samples)
def test_welch_equals_statsmodels_and_pingouin(first, second):
    ours = welch(summarise(first), summarise(second))
    compared = CompareMeans(DescrStatsW(first), DescrStatsW(second))
    t, p, degrees = compared.ttest_ind(usevar="unequal")
    assert (ours.t, ours.p, ours.degrees) == pytest.approx((t, p, degrees), rel=1e-9, abs=1e-12)
    assert (ours.low, ours.high) == pytest.approx(compared.tconfint_diff(usevar="unequal"), rel=1e-9, abs=1e-9)
    table = pingouin.ttest(first, second, correction=True)
    assert ours.degrees == pytest.approx(float(table["dof"].iloc[0]), rel=1e-3)


@pytest.mark.parametrize("margin", [0.02, 0.08, 0.12, 0.3])
def test_two_one_sided_contrasts_equal_statsmodels_and_pingouin(margin):
    """With a margin that is known the two contrasts are the two one-sided tests of TOST."""
    p, (_, p_low, _), (_, p_high, _) = ttost_ind(FIRST, SECOND, -margin, margin, usevar="unequal")
    terms = (1.0, summarise(FIRST)), (-1.0, summarise(SECOND))
    above, below = contrast(*terms, constant=margin), contrast(*terms, constant=-margin)
    ours = [stats.t.sf(above.t, above.degrees), stats.t.cdf(below.t, below.degrees)]
    assert ours == pytest.approx([p_low, p_high], rel=1e-9)
    assert max(ours) == pytest.approx(
        float(pingouin.tost(FIRST, SECOND, margin, correction=True)["pval"].iloc[0]), abs=1e-3
    )
    bounds = [contrast(*terms, constant=c, confidence=ONE_SIDED) for c in (margin, -margin)]
    assert (bounds[0].low > 0 and bounds[1].high < 0) == (p < 0.05)


def test_a_pair_of_samples_equals_statsmodels():
    difference = FIRST - SECOND[:5]
    ours = contrast((1.0, summarise(difference)))
    t, p, degrees = DescrStatsW(difference).ttest_mean(0.0)
    assert (ours.t, ours.p, ours.degrees) == pytest.approx((t, p, degrees))


@settings(max_examples=40, deadline=None)
@given(samples, samples, st.floats(0.5, 30), st.floats(0.5, 30))
def test_the_ends_of_fiellers_set_are_just_rejected_by_statsmodels(first, second, lift, base):
    """rho is an end of the set where Welch's test of x against rho y, by statsmodels, has p = 0.05."""
    x, y = np.array(first) + lift, np.array(second) + base
    found = fieller(summarise(x), summarise(y))
    if np.isinf(found.low):
        assert DescrStatsW(y).ttest_mean(0.0)[1] > 0.0499, "a denominator that may be 0"
        return
    for rho in (found.low, found.high):
        compared = CompareMeans(DescrStatsW(x), DescrStatsW(rho * y))
        assert compared.ttest_ind(usevar="unequal")[1] == pytest.approx(0.05, abs=1e-6)
    inside = CompareMeans(DescrStatsW(x), DescrStatsW(found.value * y)).ttest_ind(usevar="unequal")[1]
    assert inside > 0.99


def test_spreads_equal_scipys_f_distribution():
    found = spread_ratio(Summary(0, 0.48, 5), Summary(0, 0.01, 5))
    assert found.ratio == pytest.approx(48.0**2)
    assert found.extreme
    alike = spread_ratio(summarise(FIRST), summarise(SECOND))
    f = FIRST.var(ddof=1) / SECOND.var(ddof=1)
    assert alike.p == pytest.approx(2 * min(stats.f.cdf(f, 4, 5), stats.f.sf(f, 4, 5)))
    assert not alike.extreme
    assert spread_ratio(Summary(1, 0.1, 5), Summary(1, 0.0, 5)).extreme
    assert not spread_ratio(Summary(1, np.nan, 5), Summary(1, 0.1, 5)).extreme, "unknown is no reason"


# --- numbers worked out elsewhere, and properties ---


def test_a_contrast_by_hand():
    """3 - 0.5 x 4 - 0.4 = 0.6; variances 0.25 / 5 and 0.25 x 1 / 4."""
    found = contrast((1.0, Summary(3.0, 0.5, 5)), (-0.5, Summary(4.0, 1.0, 4)), constant=-0.4)
    a, b = 0.05, 0.0625
    assert found.difference == pytest.approx(0.6)
    assert found.t == pytest.approx(0.6 / np.sqrt(a + b))
    assert found.degrees == pytest.approx((a + b) ** 2 / (a**2 / 4 + b**2 / 3))
    assert np.isnan(contrast((1.0, Summary(3.0, np.nan, 1))).low)


def test_fieller_by_hand_and_without_finite_ends():
    """Equal variances and n, rho = 1: (d - rho d0)^2 = t^2 v (1 + rho^2), with 8 degrees of freedom at rho = 1."""
    found = fieller(Summary(1.0, 0.1, 5), Summary(1.0, 0.1, 5))
    assert found.value == 1.0
    assert found.low * found.high == pytest.approx(1.0, rel=1e-6), "x / y and y / x are the same question"
    assert fieller(Summary(1.0, 0.1, 5), Summary(0.05, 1.0, 5))[1:3] == (-np.inf, np.inf)
    assert fieller(Summary(1.0, 0.0, 5), Summary(2.0, 0.0, 5))[:3] == (0.5, 0.5, 0.5)
    assert np.isnan(fieller(Summary(1.0, np.nan, 1), Summary(2.0, 0.1, 5)).low)
    negative = fieller(Summary(-0.2, 0.05, 5), Summary(0.5, 0.05, 5))
    assert negative.low < -0.4 < negative.high < 0


@pytest.mark.parametrize(("mean", "inside", "above", "below"), [
    (0.33, True, False, False), (0.75, False, True, False), (0.10, False, False, True)])  # fmt: skip
def test_nearness_names_the_side(mean, inside, above, below):
    found = nearness(Summary(mean, 0.02, 5), Summary(0.32, 0.02, 5), 0.8, 0.25)
    assert (found.inside, found.above, found.below) == (inside, above, below)
    turned = nearness(Summary(-mean, 0.02, 5), Summary(-0.32, 0.02, 5), -0.8, 0.25)
    assert (turned.inside, turned.above, turned.below) == (inside, above, below)


def test_equivalence_needs_evidence_not_its_absence():
    tight, wide = Summary(0.32, 0.02, 5), Summary(0.33, 0.30, 5)
    assert nearness(tight, Summary(0.33, 0.02, 5), 0.8, 0.25).inside
    assert not nearness(tight, wide, 0.8, 0.25).inside, "a wide interval is not equivalence"
    assert welch(tight, wide).p > 0.5


def test_equivalence_errs_at_most_five_percent_at_the_margin_of_an_estimated_gap():
    generator = np.random.default_rng(6)
    first, second = generator.normal(0.32 + 0.25 * 0.48, 0.05, (2000, 5)), generator.normal(0.32, 0.05, (2000, 5))
    wrong = [nearness(summarise(a), summarise(b), 0.8, 0.25).inside for a, b in zip(first, second, strict=True)]
    assert np.mean(wrong) < 0.065


@pytest.mark.parametrize(("spread", "expected"), [(0.1, 0.92), (0.2, 0.19), (0.24, 0.09)])
def test_power_is_the_share_of_studies_that_pass(spread, expected):
    summary = Summary(0.32, 0.48 * spread, 5)
    power = equivalence_power(summary, summary, 0.8, 0.25, np.random.default_rng(0))
    assert power == pytest.approx(expected, abs=0.03)
    studies = np.random.default_rng(1).normal(0.32, 0.48 * spread, (1000, 2, 5))
    passed = [nearness(summarise(a), summarise(b), 0.8, 0.25).inside for a, b in studies]
    assert np.mean(passed) == pytest.approx(power, abs=0.04)
    assert equivalence_power(summary, summary, 0.8, 0.25, np.random.default_rng(0)) == power
    assert np.isnan(equivalence_power(Summary(0.3, np.nan, 1), summary, 0.8, 0.25, np.random.default_rng(0)))


def test_extreme_is_beyond_the_quantile_of_f():
    """F(0.999; 4, 4) = 53.44: a ratio of standard deviations of 7.31, whichever is the larger."""
    near, far = Summary(0.0, 7.3, 5), Summary(0.0, 7.32, 5)
    one = Summary(9.0, 1.0, 5)
    assert not spread_ratio(near, one).extreme
    assert not spread_ratio(one, near).extreme
    assert spread_ratio(far, one).extreme
    assert spread_ratio(one, far).extreme
    assert not spread_ratio(far, Summary(0.0, np.nan, 1)).extreme, "one seed has no spread"
    assert not spread_ratio(Summary(0.0, 0.0, 5), Summary(0.0, 0.0, 5)).extreme


@pytest.mark.parametrize("left", [0.0, 1.2e-16])
def test_fieller_of_equal_values_is_their_ratio(left):
    """Five equal values have a standard deviation of 0 or of what floating point leaves."""
    for first, second in np.random.default_rng(0).uniform(0.1, 3, size=(200, 2)):
        found = fieller(Summary(first, left, 5), Summary(second, 1.2e-16, 5))
        assert found[:3] == pytest.approx((first / second,) * 3, rel=1e-9)


@pytest.mark.parametrize("wild", [Summary(1.0, np.inf, 5), Summary(1e300, 1e299, 5), Summary(np.nan, np.nan, 5)])
def test_fieller_of_what_is_no_number_has_no_ends(wild):
    for found in (fieller(wild, Summary(1.0, 0.1, 5)), fieller(Summary(1.0, 0.1, 5), wild)):
        assert np.isnan([found.low, found.high]).all()
