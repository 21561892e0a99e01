"""Learning curves over environment steps: mean and t-interval over seeds, one series per method."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from mtcsirl.figures.style import (
    NO_RUNS,
    NOT_ASKED,
    TARGET_COLOUR,
    Look,
    empty_panel,
    letter,
    panel_title,
    quantity,
    quantity_label,
    share_axis,
    step_axis,
    target_of,
)
from mtcsirl.results.statistics import summarise, t_interval

BINS = 40
AGENT = ["task", "seed"]
INTERVAL = Patch(facecolor="0.5", alpha=0.3, label="95 % t-interval")


@dataclass(frozen=True)
class Series:
    """One line of a panel.

    ``rows`` are tidy curve rows (task, seed, step, value) of one metric; ``expected`` the (task, seed) pairs that the
    study asks for; ``label`` the name in the legend.
    """

    label: str
    look: Look
    rows: pd.DataFrame
    expected: tuple[tuple[str, int], ...]

    @property
    def missing(self) -> list[tuple[str, int]]:
        """The (task, seed) pairs that the study asks for and that are not there."""
        found = set(zip(self.rows["task"], self.rows["seed"].astype(int), strict=True))
        return [pair for pair in self.expected if pair not in found]


def summarise_curve(rows: pd.DataFrame, bins: int = BINS) -> pd.DataFrame:
    """Mean over seeds with its 95 % t-interval: columns step, mean, low, high, n.

    A seed's value in a bin of steps is the mean over its tasks of the mean of the bin's rows, so each task counts
    once. Curves end where the shortest run ends, so that every point is a mean over the same runs. With one seed
    low and high are NaN.
    """
    if rows.empty:
        return pd.DataFrame(columns=["step", "mean", "low", "high", "n"])
    steps = rows.groupby(AGENT)["step"]
    end, bins = steps.max().min(), min(bins, steps.nunique().min())
    rows = rows[rows["step"] <= end]
    edges = np.linspace(rows["step"].min() - 1, end, bins + 1)
    binned = rows.assign(bin=np.searchsorted(edges, rows["step"], side="left"))
    per_run = binned.groupby(["bin", "seed", "task"])[["step", "value"]].mean()
    per_seed = per_run.groupby(["bin", "seed"]).mean()
    summaries = [summarise(row) for row in per_seed["value"].unstack("seed").to_numpy()]
    intervals = np.array([t_interval(summary) for summary in summaries])
    return pd.DataFrame(
        {
            "step": per_seed["step"].groupby("bin").mean().to_numpy(),
            "mean": [summary.mean for summary in summaries],
            "low": intervals[:, 0],
            "high": intervals[:, 1],
            "n": [summary.n for summary in summaries],
        }
    )


def curve_panel(axes: Axes, index: int, metric: str, series: Sequence[Series], success: Sequence[Series]) -> list[str]:
    """Draw the curves of ``metric`` as the panel with this place, titled; return what stands of it below the figure.

    ``success``: the same agents' rows of success.
    """
    target = target_of(metric)
    shortest, longest = budgets(series)
    shares = any(len(set(_last_steps(one.rows))) > 1 for one in series)
    draw_curves(axes, [own_shares(one) for one in series] if shares else series, metric, target)
    if shares:
        share_axis(axes, shortest, longest)
    else:
        step_axis(axes)
    panel_title(axes, index, curve_title(metric, target, series))
    notes = missing_note(series) + tasks_note(series) + success_note(success)
    return [f"({letter(index)}) {note}" for note in notes]


def draw_curves(axes: Axes, series: Sequence[Series], metric: str, target: float | None) -> None:
    """Draw each series with its interval and the target as a red line; its value stands in the panel's title.

    The value axis follows means and target, not the intervals: with few seeds a t-interval can be many times the axis;
    it is then cut off at the frame.
    """
    heights = [target] if target is not None else []
    for one in series:
        curve = summarise_curve(one.rows)
        if curve.empty:
            continue
        if curve["low"].notna().any():
            axes.fill_between(
                curve["step"], curve["low"], curve["high"], color=one.look.colour, alpha=0.18, linewidth=0
            )
        axes.plot(
            curve["step"],
            curve["mean"],
            color=one.look.colour,
            linestyle=one.look.linestyle,
            marker=one.look.marker,
            markevery=max(1, len(curve) // 6),
            label=one.label,
        )
        heights.append(curve["mean"].max())
    if target is not None:
        axes.axhline(target, color=TARGET_COLOUR, linewidth=1, label="target")
    axes.set_ylim(0, 1.2 * max(heights, default=1.0))
    axes.set_xlim(left=0)
    axes.set_ylabel(quantity_label(metric))
    axes.locator_params(axis="x", nbins=4)
    if all(one.rows.empty for one in series):
        empty_panel(axes, NO_RUNS if any(one.expected for one in series) else NOT_ASKED)


def own_shares(series: Series) -> Series:
    """The series with each row's ``step`` in percent of its own run's: tasks have budgets of their own.

    A mean over tasks that ended with the shortest run would show the others half trained.
    """
    share = 100 * series.rows["step"] / series.rows.groupby(AGENT)["step"].transform("max")
    return replace(series, rows=series.rows.assign(step=share))


def budgets(series: Sequence[Series]) -> tuple[int, int]:
    """The fewest and the most steps of a run of any series; zeros where there is none."""
    last = [int(step) for one in series for step in _last_steps(one.rows)]
    return min(last, default=0), max(last, default=0)


def _last_steps(rows: pd.DataFrame) -> pd.Series:
    return rows.groupby(AGENT)["step"].max()


def add_legend(figure: Figure, axes: list[Axes], tasks: str) -> None:
    """One legend above all panels, each method once, the target and the band last; ``tasks`` above it."""
    entries = {label: line for panel in axes for line, label in zip(*panel.get_legend_handles_labels(), strict=True)}
    order = sorted(entries.values(), key=lambda line: line.get_label() == "target")
    bands = [INTERVAL] if any(panel.collections for panel in axes) else []
    if entries:
        figure.legend(handles=order + bands, loc="outside upper center", ncols=len(order + bands), title=tasks)


def missing_note(series: Sequence[Series]) -> list[str]:
    """One line that names the runs that are not there yet; nothing if all are."""
    parts = []
    for one in series:
        if one.missing and len(one.missing) == len(one.expected):
            parts.append(f"{one.label}: all runs")
        elif one.missing:
            parts.append(f"{one.label}: {_pairs(one.missing)}")
    return [f"not there yet – {'; '.join(parts)}"] if parts else []


def tasks_note(series: Sequence[Series]) -> list[str]:
    """One line that names over which tasks a series is a mean where those are not all that the study asks for."""
    parts = []
    for one in series:
        there = list(dict.fromkeys(task for task, seed in one.expected if (task, seed) not in one.missing))
        if one.missing and there and len({task for task, _ in one.expected}) > 1:
            uneven = {(task, seed) for task in there for _, seed in one.expected} & set(one.missing)
            parts.append(f"{one.label}: {', '.join(there)}{' (not of every seed)' if uneven else ''}")
    return [f"mean over the tasks that are there – {'; '.join(parts)}"] if parts else []


def success_note(series: Sequence[Series]) -> list[str]:
    """One line with the success of each series' agents in the last tenth of their own steps, from rows of ``success``.

    Curves of a cs-reward do not show an agent that has the behaviour and has lost its task.
    """
    said = [f"{one.label} {100 * _last_tenth(one.rows):.0f} %" for one in series if len(one.rows)]
    return [f"success in the last tenth of training: {', '.join(said)}"] if said else []


def _last_tenth(rows: pd.DataFrame) -> float:
    """Mean over agents of each one's mean after nine tenths of its steps; every task counts once."""
    late = rows[rows["step"] > 0.9 * rows.groupby(AGENT)["step"].transform("max")]
    return float(late.groupby(AGENT)["value"].mean().groupby("task").mean().mean())


def curve_title(metric: str, target: float | None, series: Sequence[Series]) -> str:
    """As in "Velocity, target 0.8, n = 5": a label at the line would cover the curves that reach it.

    n: seeds of a series, the fewest and the most where they differ; a series that is not there has none.
    """
    said = [quantity(metric).capitalize()]
    if target is not None:
        said.append(f"target {target:g}")
    numbers = sorted({one.rows["seed"].nunique() for one in series} - {0})
    if numbers:
        said.append(f"n = {numbers[0]}" if len(numbers) == 1 else f"n = {numbers[0]} to {numbers[-1]}")
    return ", ".join(said)


def _pairs(missing: Sequence[tuple[str, int]]) -> str:
    names = [f"{task} seed {seed}" for task, seed in missing]
    return ", ".join(names) if len(names) <= 3 else f"{len(names)} runs"


def counts(series: Sequence[Series]) -> str:
    """Seeds per series for a caption, as in ``n = 5 seeds``; per series where they differ."""
    numbers = {one.label: one.rows["seed"].nunique() for one in series}
    if len(set(numbers.values())) == 1:
        return f"n = {_seeds(next(iter(numbers.values())))}"
    return "n = " + ", ".join(f"{_seeds(number)} ({label})" for label, number in numbers.items())


def _seeds(number: int) -> str:
    return f"{number} seed" if number == 1 else f"{number} seeds"
