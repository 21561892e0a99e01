"""Scatter of the true against the learned cs-reward, with the correlation over seeds."""

from dataclasses import dataclass

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from mtcsirl.figures.data import FigureData, rows_where
from mtcsirl.figures.style import (
    NO_RUNS,
    TEXT_WIDTH,
    add_notes,
    empty_panel,
    look,
    new_figure,
    quantity,
    quantity_label,
    scale_notes,
    styled,
)
from mtcsirl.results.published import load_published
from mtcsirl.results.statistics import Estimate, mean_correlation

SHOWN_POINTS = 2000
PRIMARY_TRANSITIONS = "sac"
"""The set of all scatters: the plain SAC agent of the scored task varies in both cs-rewards, the expert hardly does."""
TRANSITION_SETS = {
    "expert": "expert transitions",
    "sac": "plain SAC transitions",
    "generator": "generator transitions",
    "uniform": "uniformly random actions",
}


@dataclass(frozen=True)
class Correlation:
    """Points and correlation of one learned reward on one transition set of ``task``, all seeds.

    ``partial``: the correlation given r_task, as r alone may be that of the task reward. ``paper``: its r, or NaN.
    """

    points: pd.DataFrame
    estimate: Estimate
    partial: Estimate
    task: str
    transitions: str
    paper: float

    @property
    def transition_name(self) -> str:
        """The transition set in words."""
        return TRANSITION_SETS.get(self.transitions, self.transitions)

    @property
    def per_seed(self) -> int:
        """Transitions per seed (the largest number)."""
        return int(self.points.groupby("seed").size().max()) if len(self.points) else 0

    def counts(self) -> str:
        """As in ``n = 5 seeds``."""
        seeds = self.points["seed"].nunique()
        return f"n = {seeds} seed" if seeds == 1 else f"n = {seeds} seeds"

    def words(self) -> str:
        """As in ``r = 0.18 [0.05, 0.30]``."""
        return correlation_words(self.estimate)

    def partial_words(self) -> str:
        """As in ``given r_task: 0.18 [0.05, 0.30]``; nothing where it was not scored."""
        known = not np.isnan(self.partial.value)
        return f"given r_task: {correlation_words(self.partial).removeprefix('r = ')}" if known else ""


def select_correlation(
    data: FigureData,
    *,
    experiment: str,
    method: str,
    cs_reward: str,
    source: str,
    task: str,
    transitions: str = PRIMARY_TRANSITIONS,
) -> Correlation:
    """Points, Pearson's r and the partial r given r_task of the learned reward of ``source`` on ``transitions``.

    ``task``: the one on which these rewards are scored, for the words alone.
    Over seeds r is averaged on Fisher's z scale with a t-interval; one seed keeps the interval that its own row has.
    """
    wanted = {"experiment": experiment, "method": method, "cs_reward": cs_reward, "source": source}
    points = rows_where(data.points, wanted | {"transitions": transitions})
    scores = rows_where(data.scores, wanted | {"transitions": transitions, "reward": "learned"})
    paper = load_published().correlation(experiment, cs_reward).mean
    return Correlation(points, _over_seeds(scores, "pearson"), _over_seeds(scores, "partial"), task, transitions, paper)


def _over_seeds(scores: pd.DataFrame, statistic: str) -> Estimate:
    rows = rows_where(scores, {"statistic": statistic})
    if len(rows) == 1:
        row = rows.iloc[0]
        return Estimate(row["value"], row["low"], row["high"], 1)
    return mean_correlation(rows["value"])


def draw_scatter(axes: Axes, found: Correlation, method: str, cs_reward: str, words_share: float = 0.5) -> None:
    """Truth on the horizontal, learned on the vertical axis; one point per transition.

    A learned reward is known up to scale and offset, so each seed's is standardised (mean 0, standard deviation 1).
    The line is the least-squares fit over the seeds, which all weigh the same. The words stand above the points, in
    the upper ``words_share`` of the panel.
    """
    axes.set_xlabel(f"true cs-reward,\n{quantity_label(cs_reward)}")
    axes.set_ylabel("learned cs-reward\n(standardised per seed)")
    if found.points.empty:
        axes.set_yticks([])
        empty_panel(axes, NO_RUNS)
        return
    standard = standardise(found.points)
    shown = standard.iloc[np.linspace(0, len(standard) - 1, min(SHOWN_POINTS, len(standard))).astype(int)]
    axes.scatter(
        shown["truth"],
        shown["learned"],
        s=3,
        color=look(method).colour,
        alpha=float(np.clip(300 / len(shown), 0.25, 0.8)),
        linewidths=0,
        rasterized=True,
    )
    if standard["truth"].nunique() > 1:
        slope, offset = np.polyfit(standard["truth"], standard["learned"], 1)
        ends = np.array([standard["truth"].min(), standard["truth"].max()])
        axes.plot(ends, slope * ends + offset, color="black", linewidth=1, linestyle="--")
    low, high = np.percentile(standard["learned"], [0.2, 99.8])
    margin = 0.08 * max(high - low, 1e-6)
    axes.set_ylim(low - margin, low - margin + (high - low + 2 * margin) / (1 - words_share))
    paper = "" if np.isnan(found.paper) else f"paper: r = {found.paper:.2f}"
    where = f"{found.task}, {found.counts()}"
    lines = filter(None, (found.words(), found.partial_words(), paper, found.transition_name, where))
    words = axes.text(0.03, 0.98, "\n".join(lines), transform=axes.transAxes, va="top", fontsize=6)
    words.set_in_layout(False)


def standardise(points: pd.DataFrame) -> pd.DataFrame:
    """``learned`` with mean 0 and standard deviation 1 within each seed; a constant reward becomes 0."""
    learned = points.groupby("seed")["learned"]
    spread = learned.transform("std", ddof=0)
    centred = points["learned"] - learned.transform("mean")
    return points.assign(learned=(centred / spread.where(spread > 0)).fillna(0.0))


def correlation_words(estimate: Estimate) -> str:
    """As in ``r = 0.18 [0.05, 0.30]``; without an interval where there is none."""
    if np.isnan(estimate.value):
        return "r undefined"
    interval = "" if np.isnan(estimate.low) else f" [{estimate.low:.2f}, {estimate.high:.2f}]"
    return f"r = {estimate.value:.2f}{interval}"


def scatter_caption(found: Correlation, cs_reward: str) -> str:
    """What a scatter shows: set, number of points and seeds, correlation with its interval."""
    interval = "95 % t-interval over seeds on Fisher's z scale" if found.estimate.n > 1 else "95 % bootstrap interval"
    if np.isnan(found.estimate.low):
        interval = "no interval from so few data"
    paper = "" if np.isnan(found.paper) else f" (paper: {found.paper:.2f})"
    if found.points.empty and np.isnan(found.estimate.value):
        return f"True against learned {quantity(cs_reward)} cs-reward{paper}: {NO_RUNS}."
    partial = found.partial_words() and f"{found.partial_words()}, "
    return (
        f"True against learned {quantity(cs_reward)} cs-reward on {found.transition_name} of {found.task}: "
        f"Pearson {found.words()}{paper}, {partial}{interval}, {found.counts()} with up to {found.per_seed:,} "
        "transitions each; "
        f"at most {SHOWN_POINTS:,} points are drawn, without the outermost 0.4 %. The learned reward is standardised "
        "per seed."
    )


@styled
def scatter_figure(scale: str, found: Correlation, method: str, cs_reward: str) -> Figure:
    """A figure of one scatter."""
    figure = new_figure(0.52 * TEXT_WIDTH, 2.4)
    draw_scatter(figure.subplots(), found, method, cs_reward, words_share=0.33)
    add_notes(figure, scale_notes(scale))
    return figure
