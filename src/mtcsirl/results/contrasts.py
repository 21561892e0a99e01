"""Questions about two groups that a difference of means does not answer: ratios, equivalence, spreads, pairs.

Everything here reads summaries (mean, std, n) of independent seeds; notation as in :mod:`mtcsirl.results.statistics`.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from scipy import stats
from scipy.optimize import brentq

from mtcsirl.results.statistics import HUGE, ONE_SIDED, Array, Estimate, Summary, Welch, contrast


class Nearness(NamedTuple):
    """Where one group stands between two limits: ``upper`` tests against the one above, ``lower`` the one below.

    Both are contrasts with one-sided 95 % bounds as the ends of their intervals.
    """

    upper: Welch
    lower: Welch

    @property
    def inside(self) -> bool:
        """Surely between both limits: two one-sided tests at 5 %."""
        return bool(self.upper.high < 0 < self.lower.low)

    @property
    def above(self) -> bool:
        """Surely beyond the upper limit."""
        return bool(self.upper.low > 0)

    @property
    def below(self) -> bool:
        """Surely beyond the lower limit."""
        return bool(self.lower.high < 0)


def nearness(ours: Summary, base: Summary, target: float, margin: float) -> Nearness:
    """Whether ``ours`` lies within ``margin`` x the gap from ``base`` to ``target`` of ``base``.

    The gap is estimated, not known, so that the limits are contrasts: with m, m_0 the means and tau the target above
    m_0, m - (1 - q) m_0 - q tau < 0 and m - (1 + q) m_0 + q tau > 0 for q = ``margin``. Signs turn where the target
    lies below ``base``; "above" is always towards the target.
    """
    sign = -1.0 if target < base.mean else 1.0

    def limit(part: float) -> Welch:
        terms = (sign, ours), (-sign * (1 - part), base)
        return contrast(*terms, constant=-sign * part * target, confidence=ONE_SIDED)

    return Nearness(limit(margin), limit(-margin))


def equivalence_power(
    ours: Summary,
    base: Summary,
    target: float,
    margin: float,
    generator: np.random.Generator,
    *,
    studies: int = 4000,
) -> float:
    """Share of made-up studies in which ``nearness`` says inside, if both means were equal.

    Spreads, gap and numbers of seeds are those of ``ours`` and ``base``; NaN where one has no spread to go by.
    """
    if ours.n < 2 or base.n < 2:
        return np.nan
    means = [generator.normal(base.mean, s.std / np.sqrt(s.n), studies) for s in (ours, base)]
    variances = [s.std**2 * generator.chisquare(s.n - 1, studies) / (s.n - 1) / s.n for s in (ours, base)]
    gap = target - means[1]
    error = margin * np.abs(gap)
    reach = [_one_sided(variances[0], (1 + side * margin) ** 2 * variances[1], ours.n, base.n) for side in (-1, 1)]
    difference = np.where(gap < 0, -1.0, 1.0) * (means[0] - means[1])
    return float(np.mean((difference + reach[0] < error) & (difference - reach[1] > -error)))


def _one_sided(first: Array, second: Array, n_first: int, n_second: int) -> Array:
    """t(0.95) x error of a contrast with these two parts of its variance [studies]; 0 without any."""
    total = first + second
    safe = np.where(total > 0, total, 1.0)
    degrees = safe**2 / np.maximum(first**2 / (n_first - 1) + second**2 / (n_second - 1), 1e-300)
    return np.asarray(stats.t.ppf((1 + ONE_SIDED) / 2, degrees) * np.sqrt(total))


def fieller(numerator: Summary, denominator: Summary, confidence: float = 0.95) -> Estimate:
    """The ratio of two independent means with Fieller's set: all rho that the data do not reject.

    {rho: (d - rho d_0)^2 <= t^2 (s^2 / n + rho^2 s_0^2 / n_0)}, t with the degrees of freedom of the contrast d - rho
    d_0, so that the set holds exactly the ratios which that contrast accepts. Where the denominator is not surely
    different from 0 the set has no finite ends, and the interval is (-inf, inf).
    """
    return fieller_of([(1.0, numerator)], denominator, confidence)


def fieller_of(terms: Sequence[tuple[float, Summary]], denominator: Summary, confidence: float = 0.95) -> Estimate:
    """As ``fieller``, of a sum of weight x mean over ``terms`` of independent samples; n is the first one's."""
    numerator, n = sum(weight * summary.mean for weight, summary in terms), terms[0][1].n
    value = numerator / denominator.mean if denominator.mean else np.nan
    samples = [denominator, *(summary for _, summary in terms)]
    known = all(one.n >= 2 and one.std < HUGE for one in samples)
    if not known or not np.isfinite(value):
        return Estimate(value, np.nan, np.nan, n)

    def excess(angle: float) -> float:
        """|d cos - d_0 sin| minus what the contrast accepts; rho is the tangent of the angle."""
        scaled = [(float(np.cos(angle)) * weight, summary) for weight, summary in terms]
        test = contrast(*scaled, (-float(np.sin(angle)), denominator), confidence=confidence)
        return abs(test.difference) - (test.high - test.low) / 2

    if excess(np.pi / 2) <= 0:
        return Estimate(value, -np.inf, np.inf, n)
    best = float(np.arctan(value))
    if excess(best) >= 0:  # no spread, or none that floating point can tell from it
        return Estimate(value, value, value, n)
    low, high = (np.tan(brentq(excess, *sorted((best, side * np.pi / 2)))) for side in (-1, 1))
    return Estimate(value, float(low), float(high), n)


EXTREME = 0.002
"""Two-sided: F beyond its 99.9 % quantile, the larger spread above."""


class SpreadRatio(NamedTuple):
    """F = s_1^2 / s_2^2 and its two-sided p under equal spreads."""

    ratio: float
    p: float

    @property
    def extreme(self) -> bool:
        """The two spreads are surely not those of the same quantity; a study has dozens of such pairs."""
        return bool(self.p < EXTREME)


def spread_ratio(first: Summary, second: Summary) -> SpreadRatio:
    """F test of two spreads; NaN where one is unknown, p = 0 where only one of them is 0."""
    if first.n < 2 or second.n < 2 or not np.isfinite([first.std, second.std]).all():
        return SpreadRatio(np.nan, np.nan)
    if second.std == 0:
        return SpreadRatio(np.inf if first.std else 1.0, 0.0 if first.std else 1.0)
    ratio = (first.std / second.std) ** 2
    tails = stats.f.sf(ratio, first.n - 1, second.n - 1), stats.f.cdf(ratio, first.n - 1, second.n - 1)
    return SpreadRatio(float(ratio), float(min(1.0, 2 * min(tails))))
