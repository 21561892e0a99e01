"""Statistics of a replication over matrices of runs x tasks; every random draw takes an explicit generator.

Notation: m, s, n are mean, standard deviation (ddof = 1) and number of values, t(q, k) a quantile of Student's t with
k degrees of freedom. NaN marks a missing seed: it is left out and n says so. Fewer than two values have no spread:
std and interval are NaN, never 0.
"""

from collections.abc import Callable, Sequence
from functools import cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]


class Interval(NamedTuple):
    """Lower and upper bound."""

    low: float
    high: float

    def contains(self, value: float) -> bool:
        """Whether ``value`` lies inside, bounds included; False for an interval of NaN."""
        return bool(self.low <= value <= self.high)


class Summary(NamedTuple):
    """Mean, standard deviation (ddof = 1) and number of values."""

    mean: float
    std: float
    n: int


class Estimate(NamedTuple):
    """A statistic with its interval and the number of values behind it."""

    value: float
    low: float
    high: float
    n: int


class Welch(NamedTuple):
    """Welch's test of two means: difference, its confidence interval, t, degrees of freedom, two-sided p."""

    difference: float
    low: float
    high: float
    t: float
    degrees: float
    p: float


UNKNOWN_INTERVAL = Interval(np.nan, np.nan)
ONE_SIDED = 0.90
"""Confidence of the interval whose two ends are one-sided 95 % bounds."""
HUGE = 1e150
"""A number whose square is none: nothing is tested with it."""


def summarise(values: ArrayLike) -> Summary:
    """Mean, std (ddof = 1) and n of ``values`` [runs]; NaN are missing seeds."""
    known = _known(values)
    mean = float(known.mean()) if known.size else np.nan
    std = float(known.std(ddof=1)) if known.size > 1 else np.nan
    return Summary(mean, std, int(known.size))


def t_interval(summary: Summary, confidence: float = 0.95) -> Interval:
    """Interval m +- t((1 + confidence) / 2, n - 1) s / sqrt(n) of the mean."""
    if summary.n < 2:
        return UNKNOWN_INTERVAL
    half = float(_t(confidence, summary.n - 1) * summary.std / np.sqrt(summary.n))
    return Interval(summary.mean - half, summary.mean + half)


def prediction_interval(original: Summary, runs: int, confidence: float = 0.95) -> Interval:
    """Where the mean of ``runs`` new seeds lies if nothing but the seeds differs from the original.

    m +- t((1 + confidence) / 2, n0 - 1) s sqrt(1 / n0 + 1 / n1) with n0 the original's seeds and n1 = ``runs``.
    """
    if original.n < 2 or runs < 1:
        return UNKNOWN_INTERVAL
    half = float(_t(confidence, original.n - 1) * original.std * np.sqrt(1 / original.n + 1 / runs))
    return Interval(original.mean - half, original.mean + half)


def contrast(*terms: tuple[float, Summary], constant: float = 0.0, confidence: float = 0.95) -> Welch:
    """Test of ``constant`` + sum of weight x mean against 0, for (weight, summary) of independent samples.

    v_i = (w_i s_i)^2 / n_i; the error is sqrt(sum v_i) with (sum v_i)^2 / sum(v_i^2 / (n_i - 1)) degrees of freedom,
    after Welch and Satterthwaite. Without any spread the interval is the value itself.
    """
    from scipy import stats

    value = constant + sum(weight * summary.mean for weight, summary in terms)
    if not all(summary.n >= 2 and abs(weight * summary.std) < HUGE for weight, summary in terms):
        return Welch(value, np.nan, np.nan, np.nan, np.nan, np.nan)
    parts = [(weight * summary.std) ** 2 / summary.n for weight, summary in terms]
    error = float(np.sqrt(sum(parts)))
    if error == 0:
        return Welch(value, value, value, np.nan, np.nan, 1.0 if value == 0 else 0.0)
    shares = [v / sum(parts) for v in parts]  # whose squares are numbers, however small the parts
    degrees = 1 / sum(share**2 / (summary.n - 1) for share, (_, summary) in zip(shares, terms, strict=True))
    half = _t(confidence, degrees) * error
    t = value / error
    return Welch(value, value - half, value + half, float(t), degrees, float(2 * stats.t.sf(abs(t), degrees)))


def welch(first: Summary, second: Summary, confidence: float = 0.95) -> Welch:
    """Welch's test of ``first`` - ``second``, from summaries so that a paper's printed numbers can enter."""
    return contrast((1.0, first), (-1.0, second), confidence=confidence)


def hedges_g(first: Summary, second: Summary, confidence: float = 0.95) -> Estimate:
    """Hedges' g = J (m1 - m2) / s_pooled, J = 1 - 3 / (4 k - 1), k = n1 + n2 - 2, with its interval.

    The interval inverts the noncentral t distribution (exact for equal variances). Without spread g is 0 or infinite
    and has no interval.
    """
    degrees = first.n + second.n - 2
    if not all(one.n >= 2 and one.std < HUGE and abs(one.mean) < HUGE for one in (first, second)):
        return Estimate(np.nan, np.nan, np.nan, first.n + second.n)
    pooled = float(np.sqrt(((first.n - 1) * first.std**2 + (second.n - 1) * second.std**2) / degrees))
    difference = first.mean - second.mean
    if pooled <= 1e-12 * max(abs(first.mean), abs(second.mean)):  # equal values differ by as much in floating point
        g = 0.0 if difference == 0 else float(np.copysign(np.inf, difference))
        return Estimate(g, np.nan, np.nan, first.n + second.n)
    correction = 1 - 3 / (4 * degrees - 1)
    d = difference / pooled
    root = float(np.sqrt(first.n * second.n / (first.n + second.n)))
    low, high = _noncentrality(d * root, degrees, confidence)
    return Estimate(float(correction * d), correction * low / root, correction * high / root, first.n + second.n)


def interquartile_mean(matrix: ArrayLike) -> float:
    """Mean of the middle half of all values, runs and tasks pooled (25 % trimmed from each end)."""
    known = np.sort(_known(matrix))  # scipy's trim_mean takes ten times as long, which a bootstrap feels
    cut = known.size // 4
    return float(known[cut : known.size - cut].mean()) if known.size else np.nan


def probability_of_improvement(first: ArrayLike, second: ArrayLike) -> float:
    """P(X > Y) + P(X = Y) / 2 per task, averaged over tasks; [runs, tasks] each, runs may differ."""
    a, b = _matrix(first), _matrix(second)
    if a.shape[1] != b.shape[1]:
        raise ValueError(f"both need the same tasks: {a.shape[1]} and {b.shape[1]} columns")
    return float(np.mean([_superiority(x[~np.isnan(x)], y[~np.isnan(y)]) for x, y in zip(a.T, b.T, strict=True)]))


def stratified_bootstrap(
    matrices: Sequence[ArrayLike],
    statistic: Callable[..., float],
    generator: np.random.Generator,
    *,
    resamples: int = 2000,
    confidence: float = 0.95,
) -> Estimate:
    """Percentile bootstrap of ``statistic(*matrices)`` that draws runs anew within each task.

    Each matrix is [runs, tasks]. Below ten runs such intervals are too short (84 % at n = 5): print t-intervals beside.
    """
    known = [[column[~np.isnan(column)] for column in _matrix(matrix).T] for matrix in matrices]
    n = sum(column.size for columns in known for column in columns)
    if any(column.size == 0 for columns in known for column in columns):
        return Estimate(np.nan, np.nan, np.nan, n)
    value = statistic(*[_stack(columns) for columns in known])
    draws = [
        statistic(*[_stack([generator.choice(column, column.size) for column in columns]) for columns in known])
        for _ in range(resamples)
    ]
    return Estimate(float(value), *_percentiles(draws, confidence), n)


def cluster_bootstrap(
    statistic: Callable[[NDArray[np.intp]], float],
    clusters: Sequence[ArrayLike],
    generator: np.random.Generator,
    *,
    resamples: int = 1000,
    confidence: float = 0.95,
) -> Estimate:
    """Percentile bootstrap of ``statistic(indices)`` that draws whole clusters, outermost first.

    ``clusters`` are label vectors [rows], for example (seed, episode): seeds are drawn with replacement, then within
    each drawn seed its episodes; rows of an episode stay together since they are not independent. n = clusters of the
    innermost level; one cluster has no interval.
    """
    labels = np.column_stack([np.unique(np.asarray(level), return_inverse=True)[1] for level in clusters])
    rows = np.arange(len(labels))
    n = len(np.unique(labels, axis=0))
    tree = _tree(rows, labels)
    if n < 2:
        return Estimate(float(statistic(rows)), np.nan, np.nan, n)
    draws = [statistic(np.concatenate(_draw(tree, generator))) for _ in range(resamples)]
    return Estimate(float(statistic(rows)), *_percentiles(draws, confidence), n)


def mean_correlation(correlations: ArrayLike, confidence: float = 0.95) -> Estimate:
    """Mean correlation over seeds on Fisher's z scale with the t-interval of that mean, back in r."""
    clipped = np.clip(_known(correlations), -1 + 1e-12, 1 - 1e-12)
    summary = summarise(np.arctanh(clipped))
    low, high = t_interval(summary, confidence)
    return Estimate(float(np.tanh(summary.mean)), float(np.tanh(low)), float(np.tanh(high)), summary.n)


def _known(values: ArrayLike) -> Array:
    array = np.asarray(values, dtype=float).ravel()
    known: Array = array[~np.isnan(array)]
    return known


def _matrix(values: ArrayLike) -> Array:
    array = np.asarray(values, dtype=float)
    if array.ndim != 2:
        raise ValueError(f"needs a matrix [runs, tasks], got shape {array.shape}")
    return array


def _stack(columns: list[Array]) -> Array:
    """Columns of unequal length as one matrix, NaN below the shorter ones."""
    stacked = np.full((max(column.size for column in columns), len(columns)), np.nan)
    for task, column in enumerate(columns):
        stacked[: column.size, task] = column
    return stacked


def _superiority(x: Array, y: Array) -> float:
    if not (x.size and y.size):
        return np.nan
    difference = x[:, None] - y[None, :]
    return float(np.mean((difference > 0) + 0.5 * (difference == 0)))


def _percentiles(draws: Sequence[float], confidence: float) -> Interval:
    if np.isnan(draws).all():
        return UNKNOWN_INTERVAL
    low, high = np.nanpercentile(draws, [50 * (1 - confidence), 50 * (1 + confidence)])
    return Interval(float(low), float(high))


def _t(confidence: float, degrees: float) -> float:
    from scipy import stats

    return float(stats.t.ppf((1 + confidence) / 2, degrees))


@cache
def _chi_nodes(degrees: int) -> tuple[Array, Array]:
    """sqrt(q(u) / k) at the nodes u in [0, 1] of Gauss and Legendre, and the weights (they sum to 2)."""
    from scipy import stats

    nodes, weights = np.polynomial.legendre.leggauss(300)
    return np.sqrt(stats.chi2.ppf((nodes + 1) / 2, degrees) / degrees), weights


def _noncentrality(t: float, degrees: int, confidence: float) -> Interval:
    """Noncentrality parameters c under which ``t`` is the upper and the lower tail quantile.

    P(T <= t | c) = integral over u in [0, 1] of Phi(t sqrt(q(u) / k) - c), q the quantile function of chi-squared with
    k degrees of freedom; Gauss-Legendre, since scipy's noncentral t has no numbers in its far tails.
    """
    from scipy.optimize import brentq
    from scipy.special import ndtr

    root, weights = _chi_nodes(degrees)
    scaled = t * root

    def solve(probability: float) -> float:
        def miss(c: float) -> float:
            return float(weights @ ndtr(scaled - c)) / 2 - probability

        return float(brentq(miss, scaled.min() - 5, scaled.max() + 5))

    return Interval(solve((1 + confidence) / 2), solve((1 - confidence) / 2))


def _tree(rows: NDArray[np.intp], labels: NDArray[np.intp]) -> list[Any]:
    """Rows grouped by the first label column, then by the next; leaves are arrays of row numbers."""
    groups = [labels[:, 0] == value for value in np.unique(labels[:, 0])]
    if labels.shape[1] == 1:
        return [rows[group] for group in groups]
    return [_tree(rows[group], labels[group, 1:]) for group in groups]


def _draw(tree: list[Any], generator: np.random.Generator) -> list[NDArray[np.intp]]:
    picked = [tree[i] for i in generator.integers(len(tree), size=len(tree))]
    if isinstance(picked[0], list):
        return [leaf for branch in picked for leaf in _draw(branch, generator)]
    return picked
