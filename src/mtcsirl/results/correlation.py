"""How well a learned reward f agrees with the true cs-reward on a set of transitions.

Four views, since none is right alone. Pearson and Spearman on the transitions as they are ignore scale and offset
(and, Spearman, any monotone bend), but not what AIRL may add without changing what is optimal. The *residual*
correlations therefore first remove, by least squares, the task reward and a linear potential difference from both f and
the truth: Pearson's is 1 exactly if f = a r_cs + b r_task + gamma phi(s') - phi(s) + c with a > 0 and phi linear in the
observation. The *partial* correlation asks what f says of the truth beyond the task: it holds r_task fixed, and so is
NaN for f = -r_task, which correlates with the truth wherever slow policies please the task. EPIC removes every
potential, but pairs states with successors that no policy ever saw together (see ``epic_values``).
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
import torch

from mtcsirl.results.statistics import Array, Estimate, cluster_bootstrap
from mtcsirl.transitions import RewardFunction, Transitions

Correlation = Callable[..., float]
"""Of two vectors [N], or of three with the one that is held fixed last."""


NOTHING_LEFT = 1e-10
"""1 - r^2 below which a reward in float32 is a straight line in another."""


def pearson(x: Array, y: Array) -> float:
    """Pearson's r of two vectors; NaN if one of them does not vary."""
    x, y = x - x.mean(), y - y.mean()
    scale = np.linalg.norm(x) * np.linalg.norm(y)
    return float(np.clip(x @ y / scale, -1.0, 1.0)) if scale > 1e-12 * len(x) else np.nan


def spearman(x: Array, y: Array) -> float:
    """Spearman's rank correlation of two vectors; NaN if one of them does not vary."""
    from scipy.stats import rankdata

    return pearson(rankdata(x), rankdata(y))


def partial_correlation(f: Array, c: Array, t: Array) -> float:
    """Pearson's r of ``f`` and ``c`` [N] given ``t`` [N]: of what a straight line in t leaves of both.

    r_fc.t = (r_fc - r_ft r_ct) / sqrt((1 - r_ft^2) (1 - r_ct^2)). NaN where f or c do not vary or are a straight line
    in t, to the rounding of float32: nothing is left of them. A t that does not vary explains nothing: then it is r_fc.
    """
    fc, ft, ct = pearson(f, c), pearson(f, t), pearson(c, t)
    if np.isnan(ft) and np.isnan(ct):  # t does not vary; or f or c neither, and then fc is NaN too
        return fc
    left = (1 - ft**2) * (1 - ct**2)
    if np.isnan(left) or min(1 - ft**2, 1 - ct**2) < NOTHING_LEFT:
        return np.nan
    return float(np.clip((fc - ft * ct) / np.sqrt(left), -1.0, 1.0))


def nuisance(transitions: Transitions, discount: float) -> Array:
    """Columns [N, k] that a learned reward may contain without a change of the cs-reward in it.

    A constant, r_task, and the potential differences gamma s'_i - s_i of every coordinate of the observation as the
    agent sees it, so that least squares over the columns fits a linear potential phi. A network's potential need not be
    linear: what is left of it lowers the residual correlations.
    """
    potential = discount * transitions.next_observation - transitions.observation
    columns = torch.cat(
        [torch.ones_like(transitions.task_reward)[:, None], transitions.task_reward[:, None], potential], 1
    )
    return columns.double().numpy()


def remove(values: Array, columns: Array) -> Array:
    """``values`` [N] minus their least-squares fit by ``columns`` [N, k]; constant columns do no harm."""
    scale = np.linalg.norm(columns, axis=0)
    scaled = columns[:, scale > 0] / scale[scale > 0]
    fit, *_ = np.linalg.lstsq(scaled, values, rcond=1e-10)
    rest = values - scaled @ fit
    # Rewards come in float32: a rest below its rounding is nothing, not a direction to correlate with.
    return rest if np.linalg.norm(rest) > 1e-6 * np.linalg.norm(values) else np.zeros_like(rest)


def epic_values(
    reward: RewardFunction,
    transitions: Transitions,
    discount: float,
    generator: np.random.Generator,
    samples: int = 256,
) -> Array:
    """Canonically shaped rewards [N] of transitions [N] (Gleave et al., 2021, definition 4.1).

    C(R)(s, a, s') = R(s, a, s') + E[gamma R(s', A, S') - R(s, A, S') - gamma R(S, A, S')], with S, S' and A drawn
    independently, ``samples`` of each, from the observations and actions of the set itself.

    Caveat: (s', A, S') are not transitions of the environment. A network is asked about pairs it never saw, and a truth
    that compares s with s' would read speeds that no arm can reach; here the true velocity is read from s' alone.
    """
    count = len(transitions.task_reward)
    picks = torch.from_numpy(generator.integers(count, size=(3, samples)))
    state, action, after = (
        transitions.observation[picks[0]],
        transitions.action[picks[1]],
        transitions.next_observation[picks[2]],
    )

    def mean_from(origins: torch.Tensor) -> torch.Tensor:
        """E[R(s, A, S')] for each s of ``origins`` [n, 39]."""
        n = len(origins)
        batch = Transitions(
            origins[:, None].expand(n, samples, -1),
            action.expand(n, samples, -1),
            after.expand(n, samples, -1),
            torch.zeros(n, samples),
        )
        return reward(batch).double().mean(dim=1)

    shaped = reward(transitions).double() + discount * mean_from(transitions.next_observation)
    shaped = shaped - mean_from(transitions.observation) - discount * mean_from(state).mean()
    return shaped.numpy()


def epic_distance(first: Array, second: Array) -> float:
    """sqrt((1 - r) / 2) of canonically shaped rewards.

    0: the same up to scale and shaping; 0.71: unrelated; 1: opposed.
    """
    return float(np.sqrt((1 - pearson(first, second)) / 2))


class Views(NamedTuple):
    """One learned and the true reward on the same transitions, by statistic."""

    parts: dict[str, tuple[Correlation, tuple[Array, ...]]]
    """The statistic's function and the vectors [N] that it takes."""

    def estimate(
        self, statistic: str, episodes: np.ndarray, generator: np.random.Generator, resamples: int
    ) -> Estimate:
        """The statistic with its cluster-bootstrap interval over episodes (0 resamples: without an interval)."""
        measure, vectors = self.parts[statistic]
        if not resamples:
            return Estimate(measure(*vectors), np.nan, np.nan, len(np.unique(episodes)))
        return cluster_bootstrap(
            lambda index: measure(*(vector[index] for vector in vectors)), [episodes], generator, resamples=resamples
        )


def views(learned: Array, truth: Array, transitions: Transitions, discount: float) -> Views:
    """Pearson, Spearman and partial correlation of ``learned`` and ``truth`` [N], and the first two without nuisance.

    The nuisance is fitted once: bootstrap intervals of the residual correlations hold the fit fixed. Those of the
    partial correlation fit the task reward anew in every resample.
    """
    columns = nuisance(transitions, discount)
    rest = remove(learned, columns), remove(truth, columns)
    return Views(
        {
            "pearson": (pearson, (learned, truth)),
            "spearman": (spearman, (learned, truth)),
            "partial": (partial_correlation, (learned, truth, transitions.task_reward.double().numpy())),
            "pearson_residual": (pearson, rest),
            "spearman_residual": (spearman, rest),
        }
    )
