"""All verdicts on one page."""

import textwrap
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from mtcsirl.claims.claims import (
    INCONCLUSIVE,
    NEVER_RUN,
    NOT_REPRODUCED,
    PARTIALLY,
    PRECONDITION,
    REPRODUCED,
    Finding,
    load_criteria,
)
from mtcsirl.claims.judging import BLOCKED, MET, NOT_MET, NOT_RUN, TOO_FEW, UNCLEAR, Unit
from mtcsirl.figures.style import TEXT_WIDTH, add_notes, new_figure, quantity, scale_notes, styled
from mtcsirl.settings import Settings

VERDICT_COLOURS = {
    REPRODUCED: "#009E73",
    PARTIALLY: "#56B4E9",
    NOT_REPRODUCED: "#D55E00",
    INCONCLUSIVE: "#E69F00",
    PRECONDITION: "#CC79A7",
    NEVER_RUN: "#999999",
}
_MARKS = {MET: ("o", True), NOT_MET: ("X", True), UNCLEAR: ("o", False), TOO_FEW: ("D", False)}
_GAP = 0.8
"""Between the units of one cs-reward and the next, in units."""
CAPTION = (
    "Verdicts on the paper's claims. Each mark is one judged unit (a cs-reward, or a cs-reward and a task, source or "
    "method): what the claim's criterion looks at, with its 95 % interval; filled circle: criterion met, cross: not "
    "met, open circle: unclear, open diamond: too few seeds. Black line: the criterion's limit for these units. Small "
    "triangle: the paper's number, where it prints one. Units that lack a precondition or a run are not drawn; the "
    "counts below each claim include them."
)


def limits_of(rules: Mapping[str, Any], unit: Unit) -> set[float]:
    """Where the criterion draws its lines, on the scale of the unit's measure."""
    if "distance" in rules:
        return {rules["distance"].get(unit.cs_reward, max(rules["distance"].values()))}
    if "margin" in rules:
        return {-rules["margin"], rules["margin"]}
    return {rules[name] for name in ("at_least", "at_most", "metric_advantage", "advantage") if name in rules}


@styled
def claims_figure(findings: Sequence[Finding], settings: Settings, criteria: Mapping[str, Any] | None = None) -> Figure:
    """One row per claim: its units on the scale of its measure, and its verdict in words and colour."""
    figure = new_figure(TEXT_WIDTH, 0.68 * len(findings) + 0.4)
    rows = figure.subplots(len(findings), 2, width_ratios=[1.0, 1.2], squeeze=False)
    for (left, right), finding in zip(rows, findings, strict=True):
        _draw_units(left, finding, (criteria or load_criteria())["claims"][finding.name])
        _write_verdict(right, finding)
    add_notes(figure, scale_notes(settings.scale))
    return figure


def _draw_units(axes: Axes, finding: Finding, rules: Mapping[str, Any]) -> None:
    shown = [unit for unit in finding.units if unit.state not in (NOT_RUN, BLOCKED) and np.isfinite(unit.value.value)]
    heights = _heights(shown)
    for height, unit in zip(heights, shown, strict=True):
        _draw_unit(axes, height, unit, VERDICT_COLOURS[finding.verdict])
        for limit in limits_of(rules, unit):
            axes.plot([limit, limit], [height - 0.5 - _GAP / 2, height + 0.5 + _GAP / 2], color="black", linewidth=0.8)
    if shown:
        axes.set_xlim(*_frame(rules, shown))
        axes.set_xlabel("\n".join(textwrap.wrap(shown[0].measure, 46)), labelpad=1)
        axes.set_ylim(heights[-1] + 1, heights[0] - 1)  # the first unit on top
    else:
        axes.set_xticks([])
        axes.spines["bottom"].set_visible(False)
    groups: dict[str, list[float]] = {}
    for height, unit in zip(heights, shown, strict=True):
        groups.setdefault(quantity(unit.cs_reward), []).append(height)
    axes.set_yticks([sum(own) / len(own) for own in groups.values()], list(groups), fontsize=5.5)
    axes.tick_params(axis="y", length=0)
    axes.tick_params(axis="x", labelsize=6)
    axes.grid(axis="y", visible=False)
    axes.spines["left"].set_visible(False)


def _draw_unit(axes: Axes, height: float, unit: Unit, colour: str) -> None:
    marker, filled = _MARKS[unit.state]
    if np.isfinite(unit.value.low):
        axes.plot([unit.value.low, unit.value.high], [height, height], color=colour, linewidth=0.8)
    if np.isfinite(unit.paper_value):
        axes.plot([unit.paper_value], [height], marker="v", color="0.3", markersize=3, markeredgewidth=0, zorder=5)
    face = colour if filled else "white"
    axes.plot([unit.value.value], [height], marker=marker, color=colour, markerfacecolor=face, markersize=3)


def _heights(units: Sequence[Unit]) -> list[float]:
    """One row per unit, a gap between cs-rewards."""
    heights: list[float] = []
    for index, unit in enumerate(units):
        gap = _GAP if index and unit.cs_reward != units[index - 1].cs_reward else 0.0
        heights.append(heights[-1] + 1 + gap if heights else 0.0)
    return heights


def _frame(rules: Mapping[str, Any], units: Sequence[Unit]) -> tuple[float, float]:
    """Limits of the axis: every value, limit and number of the paper; an interval is cut off one width away."""
    points = [unit.value.value for unit in units] + [unit.paper_value for unit in units]
    points += [limit for unit in units for limit in limits_of(rules, unit)] + [0.0]
    low, high = float(np.nanmin(points)), float(np.nanmax(points))
    width = high - low or 1.0
    ends = [end for unit in units for end in (unit.value.low, unit.value.high) if np.isfinite(end)]
    low, high = min([low, *(max(end, low - width) for end in ends)]), max([high, *(min(e, high + width) for e in ends)])
    return low - 0.05 * (high - low), high + 0.05 * (high - low)


def _write_verdict(axes: Axes, finding: Finding) -> None:
    axes.axis("off")

    def write(x: float, y: float, text: str, **look: Any) -> None:
        axes.text(x, y, text, va="top", transform=axes.transAxes, **look)

    write(0.0, 1.05, finding.name, fontweight="bold")
    write(0.13, 1.05, finding.verdict, fontweight="bold", color=VERDICT_COLOURS[finding.verdict])
    lines = textwrap.wrap(finding.text, 54)
    write(0.13, 0.66, "\n".join(lines), linespacing=1.15, fontsize=6.5)
    write(0.13, 0.62 - 0.36 * len(lines), "\n".join(textwrap.wrap(finding.reason, 72)), fontsize=5.5, color="0.35")
