"""The figure of the validation: agreement with the truth, new agents, generators over time."""

import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from mtcsirl.figures.style import INK, LOOKS, TARGET_COLOUR, TEXT_WIDTH, new_figure, panel_title, styled
from mtcsirl.validation.point_mass import SPEED_TARGET
from mtcsirl.validation.recovery import Findings

_LEARNED = {"four goals": (LOOKS["mt_csirl"].colour, "o"), "one goal": ("#D55E00", "D")}
_CONTROL = ("#666666", "x")
_ORDER = ("truth", "four goals", "one goal", "random", "zero", "minus task")
REQUIRED = 0.9
"""Pearson's r from which a reward counts as recovered."""


@styled
def draw(findings: Findings) -> Figure:
    """Three panels; one mark or line per seed."""
    figure = new_figure(TEXT_WIDTH, 2.3)
    axes = figure.subplots(1, 3, width_ratios=(1, 1, 1.1))
    _draw_correlations(axes[0], findings.correlations)
    _draw_agents(axes[1], findings.agents)
    _draw_generators(axes[2], findings)
    return figure


def caption(findings: Findings) -> str:
    """What the figure shows."""
    seeds = findings.agents["seed"].nunique()
    return (
        "Validation on the point mass. (a) Pearson's r of f and the true cs-reward on uniform transitions after a "
        "polynomial potential was removed from both; the line is 0.9, f = 0 has no r. (b) Speed of new agents on an "
        "unseen goal with r_task + f; lines: the soft-optimal policies with and without the cs-reward. (c) Speed of "
        "the generators during MT-CSIRL; line: the expert's on the unseen goal. "
        f"One mark or line per seed; seeds: {seeds}."
    )


def _draw_correlations(axes: Axes, rows: pd.DataFrame) -> None:
    rows = rows[(rows["statistic"] == "pearson_residual") & (rows["transitions"] == "uniform")]
    _marks(axes, rows)
    axes.axvline(REQUIRED, color=TARGET_COLOUR, linewidth=0.8, linestyle=":")
    axes.set_xlabel("Pearson's r")
    panel_title(axes, 0, "f and the truth")


def _draw_agents(axes: Axes, rows: pd.DataFrame) -> None:
    speeds = rows[rows["metric"] == "speed"]
    _marks(axes, speeds)
    axes.set_yticklabels([])
    for name, look in (("expert", "expert"), ("task_only", "sac")):
        value = speeds.loc[speeds["reward"] == name, "value"].mean()
        axes.axvline(value, color=LOOKS[look].colour, linewidth=1.0, linestyle=LOOKS[look].linestyle)
    axes.set_xlabel("speed (m/s)")
    panel_title(axes, 1, "new agents")


def _marks(axes: Axes, rows: pd.DataFrame) -> None:
    for height, name in enumerate(reversed(_ORDER)):
        values = rows.loc[rows["reward"] == name, "value"]
        colour, marker = _LEARNED.get(name, _CONTROL)
        axes.plot(values, [height] * len(values), marker, color=colour, markersize=4, linestyle="none")
    labels = [name if name in _LEARNED else f"f = {name}" for name in reversed(_ORDER)]
    axes.set_yticks(range(len(_ORDER)), labels)


def _draw_generators(axes: Axes, findings: Findings) -> None:
    rows = findings.curve[findings.curve["metric"] == "speed"]
    for (name, _), part in rows.groupby(["reward", "seed"]):
        mean = part.groupby("step")["value"].mean().rolling(8, min_periods=1).mean()
        axes.plot(mean.index / 1000, mean, color=_LEARNED[str(name)][0], linewidth=0.9)
    expert = findings.agents.query("reward == 'expert' and metric == 'speed'")["value"].mean()
    axes.axhline(expert, color=LOOKS["expert"].colour, linewidth=1.0, linestyle=LOOKS["expert"].linestyle)
    axes.set_ylim(0.3, SPEED_TARGET + 0.15)
    axes.set_xlabel("thousand environment steps", color=INK)
    axes.set_ylabel("speed (m/s)")
    panel_title(axes, 2, "generators")
