"""One cell of a table of results: ours over seeds, the paper's number and how the two compare."""

from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np
import pandas as pd

from mtcsirl.names import KEPT
from mtcsirl.results.contrasts import spread_ratio
from mtcsirl.results.notes import Note, lacks_notes
from mtcsirl.results.rows import BELOW_GATE, DUPLICATED, FOREIGN, INCOMPLETE, MISSING, STALE, matrix, select
from mtcsirl.results.statistics import (
    UNKNOWN_INTERVAL,
    Estimate,
    Interval,
    Summary,
    interquartile_mean,
    prediction_interval,
    stratified_bootstrap,
    summarise,
    t_interval,
)

DASH = "–"
PAPER_DIGITS = 2
RESAMPLES = 500
MARKS = {"below": "†", "missing": "‡", "doubtful": "§", "incomplete": "¶", "stale": "‖", "diverged": "×"}
"""Doubt about agents, printed with their number."""
MARK_TEXTS = {
    "below": "† agents below their gate; they count in the mean",
    "missing": "‡ missing agents",
    "doubtful": "§ agents left out: the evaluation repeats another seed's, or names another run than its folder",
    "incomplete": "¶ agents left out: their evaluation lacks episodes or numbers",
    "stale": "‖ agents left out: made with other settings, code or inputs than the study's",
    "diverged": "× agents with episodes in which the simulation diverged",
}
Comparison = Literal["", "inside", "outside", "uninformative"]
SIGNS: dict[Comparison, str] = {"": "", "inside": "∈", "outside": "∉", "uninformative": "?"}
SIGN_TEXTS: dict[Comparison, str] = {
    "inside": "∈ our mean lies inside the paper's 95 % prediction interval for as many new seeds as ours",
    "outside": "∉ our mean lies outside the paper's 95 % prediction interval for as many new seeds as ours",
    "uninformative": "? uninformative: the paper prints no spread that predicts ours, or a spread so far from ours "
    "(ratio of variances beyond the 99.9 % quantile of F) that the two are not of the same kind",
}


@dataclass(frozen=True)
class Cell:
    """Ours: mean and std over seeds, t-interval of the mean; the paper's, and where a replication should fall.

    ``marks``: how many agents (seed x task) are in doubt, by kind; ``expected``: seeds. A seed of which one task is not
    usable has no mean over tasks and is left out of ``ours.n``.
    """

    ours: Summary
    interval: Interval
    paper: Summary
    prediction: Interval
    deterministic: float
    iqm: Estimate
    expected: int
    marks: dict[str, int] = field(default_factory=dict)
    folders: tuple[str, ...] = ()
    """Of the runs whose rows were averaged."""
    unaveraged: int = 0
    """Usable agents of seeds that lack another task."""

    @property
    def comparison(self) -> Comparison:
        """Where our mean lies as the paper predicts it; "" where one of the two is not there."""
        if np.isnan(self.paper.mean) or np.isnan(self.ours.mean):
            return ""
        if np.isnan(self.prediction.low) or spread_ratio(self.paper, self.ours).extreme:
            return "uninformative"
        return "inside" if self.prediction.contains(self.ours.mean) else "outside"

    def ours_text(self, digits: int = 2, factor: float = 1.0, *, usual: int = 0) -> str:
        """As in "0.86±0.05 (n=5)"; a ``usual`` n is left out. ``factor`` 100 prints shares as percent."""
        if self.ours.n == 0:
            return DASH
        return _spread(self.ours, digits, digits, factor) + (f" (n={self.ours.n})" if self.ours.n != usual else "")

    def paper_text(self, digits: int = 2, factor: float = 1.0) -> str:
        """As in "0.73±0.07"; spreads keep the two digits that the paper prints: its smallest, 0.01 %, is not 0."""
        return _spread(self.paper, digits, PAPER_DIGITS, factor)

    def interval_text(self, digits: int = 2, factor: float = 1.0) -> str:
        """The t-interval of our mean."""
        return _bounds(self.interval, digits, factor)

    def prediction_text(self, factor: float = 1.0) -> str:
        """The paper's prediction interval."""
        return _bounds(self.prediction, PAPER_DIGITS, factor)

    def numbers(self) -> dict[str, Any]:
        """The cell as one row of a data frame."""
        return {
            "mean": self.ours.mean,
            "std": self.ours.std,
            "n": self.ours.n,
            "low": self.interval.low,
            "high": self.interval.high,
            "iqm": self.iqm.value,
            "iqm_low": self.iqm.low,
            "iqm_high": self.iqm.high,
            "deterministic_mean": self.deterministic,
            "paper_mean": self.paper.mean,
            "paper_std": self.paper.std,
            "prediction_low": self.prediction.low,
            "prediction_high": self.prediction.high,
            "in_prediction": self.comparison,
            "seeds_expected": self.expected,
            "agents_below_gate": self.marks.get("below", 0),
            **{f"agents_{kind}": self.marks.get(kind, 0) for kind in MARKS if kind != "below"},
        }


def unusable(rows: pd.DataFrame) -> tuple[Note, ...]:
    """What incomplete agents lack and why stale ones are stale, by their folders."""
    found = select(rows, status=(INCOMPLETE, STALE))[["folder", "lacks"]].drop_duplicates()
    return lacks_notes(found.itertuples(index=False, name=None))


def make_cell(rows: pd.DataFrame, metric: str, paper: Summary, scale: float = 1.0) -> Cell:
    """The cell of one agent over its seeds and tasks: ``metric`` / ``scale`` of its evaluation ``rows``.

    Episodes were averaged per run; here tasks are averaged per seed, then seeds. ``paper`` is in units of the result; a
    printed spread of 0 predicts nothing. Rows without ``metric`` give an empty cell of which no agent is expected.
    """
    rows = select(rows, kept=KEPT)
    chosen = select(rows, metric=metric, policy="stochastic")
    means = per_seed(chosen)
    whole = chosen[chosen["seed"].isin(list(means.dropna().index))]
    ours = summarise(means / scale)
    greedy = per_seed(select(rows, metric=metric, policy="deterministic")) / scale
    return Cell(
        ours=ours,
        interval=_possible(t_interval(ours), metric),
        paper=paper,
        prediction=_possible(prediction_interval(paper, ours.n), metric) if paper.std > 0 else UNKNOWN_INTERVAL,
        deterministic=summarise(greedy).mean,
        iqm=_interquartile(chosen, scale),
        expected=chosen["seed"].nunique(),
        marks=_marks(chosen, whole),
        folders=tuple(sorted(set(whole["folder"]))),
        unaveraged=int(chosen["value"].notna().sum() - len(whole)),
    )


def _marks(rows: pd.DataFrame, averaged: pd.DataFrame) -> dict[str, int]:
    """Agents in doubt by kind, none that are 0; ``rows``: one per agent, ``averaged``: those that count in the mean."""
    status = rows["status"]
    counts = {
        "below": (averaged["status"] == BELOW_GATE).sum(),
        "missing": (status == MISSING).sum(),
        "doubtful": status.isin([DUPLICATED, FOREIGN]).sum(),
        "incomplete": (status == INCOMPLETE).sum(),
        "stale": (status == STALE).sum(),
        "diverged": (averaged["diverged"] > 0).sum(),
    }
    return {kind: int(count) for kind, count in counts.items() if count}


def _possible(interval: Interval, metric: str) -> Interval:
    """The part of ``interval`` that ``metric`` can take; a share of episodes lies in [0, 1]."""
    if metric != "success" or np.isnan(interval.low):
        return interval
    return Interval(max(interval.low, 0.0), min(interval.high, 1.0))


def _interquartile(rows: pd.DataFrame, scale: float) -> Estimate:
    """Interquartile mean over runs x tasks with its stratified bootstrap interval; always the same random numbers."""
    values = matrix(rows).to_numpy(dtype=float) / scale
    if values.size == 0:
        return Estimate(np.nan, np.nan, np.nan, 0)
    return stratified_bootstrap([values], interquartile_mean, np.random.default_rng(0), resamples=RESAMPLES)


def per_seed(rows: pd.DataFrame) -> pd.Series:
    """Mean over tasks [seed]; NaN if one of its tasks is not usable."""
    return matrix(rows).mean(axis=1, skipna=False)


def _spread(summary: Summary, digits: int, spread_digits: int, factor: float) -> str:
    if np.isnan(summary.mean):
        return DASH
    mean = f"{factor * summary.mean:.{digits}f}"
    return mean if np.isnan(summary.std) else f"{mean}±{factor * summary.std:.{spread_digits}f}"


def _bounds(interval: Interval, digits: int, factor: float) -> str:
    if np.isnan(interval.low):
        return DASH
    return f"[{factor * interval.low:.{digits}f}, {factor * interval.high:.{digits}f}]"
