"""One cell of a table of results: ours over seeds, the paper's number and how the two compare."""

from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd

from mtcsirl.results.rows import BELOW_GATE, DUPLICATED, FOREIGN, MISSING, matrix, select
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
LINES = ("", "95 % t-interval", "paper", "ours in its prediction")
"""Labels of a cell's lines; the first is that of its row. Prediction: 95 % interval for as many new seeds as ours."""
PAPER_DIGITS = 2
RESAMPLES = 500
MARKS = {"below": "†", "missing": "‡", "doubtful": "§"}
MARK_TEXTS = {
    "below": "† agents below their gate; they count in the mean",
    "missing": "‡ missing agents",
    "doubtful": "§ agents left out: the evaluation repeats another seed's, or names another run than its folder",
}


@dataclass(frozen=True)
class Cell:
    """Ours: mean and std over seeds, t-interval of the mean; the paper's, and where a replication should fall.

    ``below``, ``missing`` and ``doubtful`` count agents (seed x task), ``expected`` seeds. A seed of which one task is
    not usable has no mean over tasks and is left out of ``ours.n``.
    """

    ours: Summary
    interval: Interval
    paper: Summary
    prediction: Interval
    deterministic: float
    iqm: Estimate
    expected: int
    below: int
    missing: int
    doubtful: int

    @property
    def inside(self) -> bool | None:
        """Whether our mean lies in the paper's 95 % prediction interval; None where there is none to judge by."""
        if np.isnan(self.prediction.low) or np.isnan(self.ours.mean):
            return None
        return self.prediction.contains(self.ours.mean)

    @property
    def marks(self) -> dict[str, int]:
        """Kinds of doubt in this cell and their counts."""
        return {kind: getattr(self, kind) for kind in MARKS if getattr(self, kind)}

    def lines(self, digits: int = 2, factor: float = 1.0) -> tuple[str, str, str, str]:
        """The cell as the texts of ``LINES``. ``factor`` 100 prints shares as percent.

        The paper's spreads keep the two digits that it prints: its smallest, 0.01 %, is not 0.
        """
        marks = "".join(f" {MARKS[kind]}{count}" for kind, count in self.marks.items())
        ours = DASH if self.ours.n == 0 else f"{_spread(self.ours, digits, digits, factor)}, n={self.ours.n}"
        bounds = _bounds(self.prediction, PAPER_DIGITS, factor)
        return (
            ours + marks,
            _bounds(self.interval, digits, factor),
            _spread(self.paper, digits, PAPER_DIGITS, factor),
            {None: DASH, True: f"inside {bounds}", False: f"outside {bounds}"}[self.inside],
        )

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
            "inside": "" if self.inside is None else str(self.inside).lower(),
            "seeds_expected": self.expected,
            "agents_below_gate": self.below,
            "agents_missing": self.missing,
            "agents_doubtful": self.doubtful,
        }


def make_cell(rows: pd.DataFrame, metric: str, paper: Summary, scale: float = 1.0) -> Cell:
    """The cell of one agent over its seeds and tasks: ``metric`` / ``scale`` of its evaluation ``rows``.

    Episodes were averaged per run; here tasks are averaged per seed, then seeds. ``paper`` is in units of the result; a
    printed spread of 0 predicts nothing.
    """
    chosen = select(rows, metric=metric, policy="stochastic")
    ours = summarise(per_seed(chosen) / scale)
    greedy = per_seed(select(rows, metric=metric, policy="deterministic")) / scale
    status = chosen["status"]
    return Cell(
        ours=ours,
        interval=_possible(t_interval(ours), metric),
        paper=paper,
        prediction=_possible(prediction_interval(paper, ours.n), metric) if paper.std > 0 else UNKNOWN_INTERVAL,
        deterministic=summarise(greedy).mean,
        iqm=_interquartile(chosen, scale),
        expected=chosen["seed"].nunique(),
        below=int((status == BELOW_GATE).sum()),
        missing=int((status == MISSING).sum()),
        doubtful=int(status.isin([DUPLICATED, FOREIGN]).sum()),
    )


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


def per_seed(rows: pd.DataFrame) -> np.ndarray:
    """Mean over tasks of each seed; NaN if one of its tasks is not usable."""
    return matrix(rows).mean(axis=1, skipna=False).to_numpy(dtype=float)


def _spread(summary: Summary, digits: int, spread_digits: int, factor: float) -> str:
    if np.isnan(summary.mean):
        return DASH
    mean = f"{factor * summary.mean:.{digits}f}"
    return mean if np.isnan(summary.std) else f"{mean}±{factor * summary.std:.{spread_digits}f}"


def _bounds(interval: Interval, digits: int, factor: float) -> str:
    if np.isnan(interval.low):
        return DASH
    return f"[{factor * interval.low:.{digits}f}, {factor * interval.high:.{digits}f}]"
