"""What a learned reward says beyond the task: partial correlations over policies, IRL seeds, agents and episodes.

With f the learned reward, c the true cs-reward and t the task reward of a transition, the partial correlation
r_fc.t = (r_fc - r_ft r_ct) / sqrt((1 - r_ft^2)(1 - r_ct^2)) is that of f and c once both have given up what t explains.
It is taken across policies: SAC, experts, generators and uniform actions count as equal parts, whatever their numbers.

Every correlation is a function of ten sums per episode, so that a resample of episodes is a weighted sum.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from scipy import stats

from mtcsirl.results.correlation import NOTHING_LEFT
from mtcsirl.results.points import POLICIES
from mtcsirl.results.statistics import Array, Estimate

SHARED = ("sac", "expert")
"""Sets whose agents are the same in every IRL run: drawn once for all of them."""
Counts = NDArray[np.int64]
_PAIRS = (("f", "f"), ("c", "c"), ("t", "t"), ("f", "c"), ("f", "t"), ("c", "t"))
ROUNDING = 1e-12
_LIMIT = 1 - 1e-9
"""A correlation of 1 has no Fisher z."""


@dataclass(frozen=True)
class Correlations:
    """r of f and c given t; r_fc itself; and r_fc - r(-t, c), what f says more than the control -t. Arrays [...]."""

    partial: Array
    raw: Array
    beyond: Array


def given_task(fc: Array, ft: Array, ct: Array) -> Array:
    """r_fc.t [...] of three correlations; NaN where f or c is a straight line in t: nothing is left of it."""
    rest = np.minimum(1 - ft**2, 1 - ct**2)
    known = rest > NOTHING_LEFT
    scale = np.sqrt(np.where(known, (1 - ft**2) * (1 - ct**2), 1.0))
    return np.where(known, (fc - ft * ct) / scale, np.nan)


def episode_sums(points: pd.DataFrame) -> pd.DataFrame:
    """Count and sums of f, c, t and their products per (seed, transitions, agent, episode) of single transitions.

    f, c and t are centred and scaled per seed first, which no correlation sees and floating point does. One that varies
    by no more than its rounding does not vary.
    """
    names = {"f": "learned", "c": "truth", "t": "task_reward"}
    columns = {name: points[column].astype(float) for name, column in names.items()}
    centred = {name: _scaled(values, points["seed"]) for name, values in columns.items()}
    sums = points[["seed", "transitions", "agent", "episode"]].assign(n=1.0, **centred)
    sums = sums.assign(**{a + b: centred[a] * centred[b] for a, b in _PAIRS})
    return sums.groupby(["seed", "transitions", "agent", "episode"], sort=True).sum().reset_index()


def _scaled(values: pd.Series, seeds: pd.Series) -> pd.Series:
    of_seed = values.groupby(seeds)
    spread, size = of_seed.transform("std", ddof=0), values.abs().groupby(seeds).transform("max")
    varies = spread > ROUNDING * size
    return (values - of_seed.transform("mean")).where(varies, 0.0) / spread.where(varies, 1.0)


def correlations(sums: Array) -> Correlations:
    """Of sums [..., 10] in the order of ``episode_sums``; NaN where one of the rewards does not vary."""
    means = sums / sums[..., :1]
    f, c, t, ff, cc, tt, fc, ft, ct = np.moveaxis(means[..., 1:], -1, 0)
    spreads = [np.sqrt(np.maximum(square - mean**2, 0.0)) for square, mean in ((ff, f), (cc, c), (tt, t))]

    def r(product: Array, first: int, second: int, means: tuple[Array, Array]) -> Array:
        scale = spreads[first] * spreads[second]
        known = scale > 1e-12
        return np.where(known, (product - means[0] * means[1]) / np.where(known, scale, 1.0), np.nan)

    r_fc, r_ft, r_ct = r(fc, 0, 1, (f, c)), r(ft, 0, 2, (f, t)), r(ct, 1, 2, (c, t))
    # A task reward that never varies explains nothing.
    r_ft, r_ct = (np.where(spreads[2] > 1e-12, x, 0.0) for x in (r_ft, r_ct))
    return Correlations(given_task(r_fc, r_ft, r_ct), r_fc, r_fc + r_ct)


@dataclass(frozen=True)
class Beyond:
    """What rewards of several IRL seeds say beyond the task, each with a 95 % interval; n: IRL seeds.

    ``partial``: r_fc.t across policies; ``beyond``: r(f, c) - r(-t, c) there; ``raw``: r(f, c) there; ``agents`` and
    ``episodes`` are counted over all sets and seeds, agents that several IRL seeds share once.
    """

    partial: Estimate
    beyond: Estimate
    raw: Estimate
    agents: int
    episodes: int
    flat: tuple[int, ...] = ()
    """IRL seeds in which one of the rewards does not vary."""
    nothing: tuple[int, ...] = ()
    """IRL seeds in which nothing of one of the rewards is left beside r_task, or which are flat."""


def beyond_task(points: pd.DataFrame, generator: np.random.Generator, *, resamples: int = 1000) -> Beyond:
    """The mean over IRL seeds, correlations on Fisher's z scale, with intervals that know what the seeds share.

    Two sources of variance add up. What every IRL seed draws anew (its reward, generators, episodes) shows in the
    spread of the K seeds, s^2 / K. The agents of ``SHARED`` are the same in all of them, which that spread cannot show:
    a bootstrap draws agents and within each its episodes, the shared agents alike in every seed, and the covariance of
    two seeds' draws is theirs. Quantiles are those of t with K - 1 degrees of freedom. Drawing seeds as well would
    count the episodes twice.

    Args:
        points: rows (seed, transitions, agent, episode, truth, learned, task_reward) of one reward on one task.
        generator: decides all draws.
        resamples: of agents and episodes.
    """
    sums = episode_sums(points[points["transitions"].isin(POLICIES)])
    parts = [part for _, part in sums.groupby("seed", sort=True)]
    found = [correlations(_weighted(part, np.ones((1, len(part))))) for part in parts]
    draws = [correlations(_weighted(part, weights)) for part, weights in _resampled(parts, generator, resamples)]

    def over_seeds(name: str, *, fisher: bool) -> Estimate:
        values = np.array([getattr(one, name)[0] for one in found])
        return _mean_over_seeds(values, np.array([getattr(one, name) for one in draws]), fisher)

    return Beyond(
        partial=over_seeds("partial", fisher=True),
        beyond=over_seeds("beyond", fisher=False),
        raw=over_seeds("raw", fisher=True),
        agents=_agents(sums),
        episodes=len(sums),
        flat=_unknown(parts, [one.raw[0] for one in found]),
        nothing=_unknown(parts, [one.partial[0] for one in found]),
    )


def _unknown(parts: Sequence[pd.DataFrame], values: Sequence[float]) -> tuple[int, ...]:
    return tuple(int(part["seed"].iloc[0]) for part, value in zip(parts, values, strict=True) if np.isnan(value))


def _agents(sums: pd.DataFrame) -> int:
    """Different ones: those of ``SHARED``, and random actions, are the same in every IRL run."""
    own = sums[["seed", "transitions", "agent"]].drop_duplicates()
    return len(own.assign(seed=own["seed"].where(own["transitions"] == "generator", -1)).drop_duplicates())


def _mean_over_seeds(values: Array, draws: Array, fisher: bool) -> Estimate:
    """Mean of ``values`` [K] with an interval from their spread and the covariance of their ``draws`` [K, B].

    Without a number in one seed (t alone gives f) there is none for all.
    """
    n = len(values)
    if not np.isfinite(values).all():
        return Estimate(np.nan, np.nan, np.nan, n)
    there, back = (_fisher, np.tanh) if fisher else (np.asarray, np.asarray)
    mean = float(there(values).mean())
    if n < 2:
        return Estimate(float(back(mean)), np.nan, np.nan, n)
    scaled = there(draws)
    covariance = np.cov(scaled[:, np.isfinite(scaled).all(axis=0)])
    common = max(0.0, float((covariance.sum() - np.trace(covariance)) / (n * (n - 1))))
    half = float(stats.t.ppf(0.975, n - 1)) * np.sqrt(there(values).var(ddof=1) / n + common)
    return Estimate(float(back(mean)), float(back(mean - half)), float(back(mean + half)), n)


def _fisher(r: Array) -> Array:
    return np.arctanh(np.clip(r, -_LIMIT, _LIMIT))


def _weighted(part: pd.DataFrame, weights: Array) -> Array:
    """Sums [B, 10] of one seed's episodes under weights [B, E], every set of transitions an equal part."""
    values = part.iloc[:, 4:].to_numpy(dtype=float)
    total = np.zeros((len(weights), values.shape[1]))
    for name in part["transitions"].unique():
        own = (part["transitions"] == name).to_numpy()
        sums = weights[:, own] @ values[own]
        total += sums / sums[:, :1]
    return total


def _resampled(
    parts: Sequence[pd.DataFrame], generator: np.random.Generator, resamples: int
) -> Iterator[tuple[pd.DataFrame, Array]]:
    """Each seed's episodes with their counts [B, E]: agents drawn with replacement, within each its episodes."""
    shared: dict[str, dict[int, Counts]] = {}
    for part in parts:
        weights = np.zeros((resamples, len(part)))
        for name in part["transitions"].unique():
            own = (part["transitions"] == name).to_numpy()
            agents = part["agent"].to_numpy()[own]
            counts = shared.get(name, {})
            if set(counts) != set(agents):
                counts = _drawn(np.unique(agents), generator, resamples)
            if name in SHARED:
                shared[name] = counts
            for agent, times in counts.items():
                episodes = own & (part["agent"] == agent).to_numpy()
                size = int(episodes.sum())
                weights[:, episodes] = generator.multinomial(times * size, np.full(size, 1 / size))
        yield part, weights


def _drawn(agents: np.ndarray, generator: np.random.Generator, resamples: int) -> dict[int, Counts]:
    """How often each agent is drawn [B]."""
    counts = generator.multinomial(len(agents), np.full(len(agents), 1 / len(agents)), resamples)
    return dict(zip(agents.tolist(), counts.T, strict=True))
