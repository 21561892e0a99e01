"""All verdicts on one page."""

import textwrap
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from mtcsirl.analysis.claims import (
    INCONCLUSIVE,
    NEVER_RUN,
    NOT_REPRODUCED,
    PARTIALLY,
    PRECONDITION,
    REPRODUCED,
    Finding,
    load_criteria,
)
from mtcsirl.analysis.judging import BLOCKED, MET, NOT_MET, NOT_RUN, TOO_FEW, UNCLEAR, Unit
from mtcsirl.figures.style import TEXT_WIDTH, add_notes, new_figure, scale_notes, styled
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
CAPTION = (
    "Verdicts on the paper's claims. Each mark is one judged unit (a cs-reward, or a cs-reward and a task, source or "
    "method): what the claim's criterion looks at, with its 95 % interval; filled circle: criterion met, cross: not "
    "met, open circle: unclear, open diamond: too few seeds. Black line: the criterion's limit, two where it differs "
    "by cs-reward. Units that lack a precondition or a run are not drawn; the counts beside the verdict include them."
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
    figure = new_figure(TEXT_WIDTH, 0.62 * len(findings) + 0.5)
    rows = figure.subplots(len(findings), 2, width_ratios=[1.0, 1.25], squeeze=False)
    for (left, right), finding in zip(rows, findings, strict=True):
        _draw_units(left, finding, (criteria or load_criteria())["claims"][finding.name])
        _write_verdict(right, finding)
    add_notes(figure, scale_notes(settings.scale))
    return figure


def _draw_units(axes: Axes, finding: Finding, rules: Mapping[str, Any]) -> None:
    shown = [unit for unit in finding.units if unit.state not in (NOT_RUN, BLOCKED) and np.isfinite(unit.value.value)]
    colour = VERDICT_COLOURS[finding.verdict]
    for height, unit in enumerate(shown):
        marker, filled = _MARKS[unit.state]
        if np.isfinite(unit.value.low):
            axes.plot([unit.value.low, unit.value.high], [height, height], color=colour, linewidth=0.8)
        face = colour if filled else "white"
        axes.plot([unit.value.value], [height], marker=marker, color=colour, markerfacecolor=face, markersize=3)
    limits = {limit for unit in shown for limit in limits_of(rules, unit)}
    for limit in limits:
        axes.axvline(limit, color="black", linewidth=0.8)
    values = [*(unit.value.value for unit in shown), *limits, 0.0]
    if shown:
        low, high = min(values), max(values)
        axes.set_xlim(low - 0.1 * (high - low) - 0.02, high + 0.1 * (high - low) + 0.02)
        axes.set_xlabel(shown[0].measure, labelpad=1)
    axes.set_ylim(-1, max(len(shown), 1))
    axes.set_yticks([])
    axes.grid(axis="y", visible=False)
    axes.spines["left"].set_visible(False)


def _write_verdict(axes: Axes, finding: Finding) -> None:
    axes.axis("off")

    def write(x: float, y: float, text: str, **look: Any) -> None:
        axes.text(x, y, text, va="top", transform=axes.transAxes, **look)

    write(0.0, 1.0, finding.name, fontweight="bold")
    write(0.1, 1.0, finding.verdict, fontweight="bold", color=VERDICT_COLOURS[finding.verdict])
    text = textwrap.wrap(finding.text, 60)
    write(0.1, 0.72, "\n".join(text), linespacing=1.15)
    write(0.1, 0.66 - 0.38 * len(text), "\n".join(textwrap.wrap(finding.reason, 75)), fontsize=5.5, color="0.35")
