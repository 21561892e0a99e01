"""All verdicts on one page: each claim as a sentence, and beside it what its verdict rests on."""

import textwrap
from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

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
from mtcsirl.claims.judging import BLOCKED, MET, NOT_MET, NOT_RUN, SHOWN, TOO_FEW, UNCLEAR, Unit
from mtcsirl.claims.scored import PARTIAL
from mtcsirl.figures.style import TEXT_WIDTH, add_notes, new_figure, quantity, scale_notes, styled
from mtcsirl.results.statistics import Interval
from mtcsirl.settings import Settings

VERDICT_COLOURS = {
    REPRODUCED: "#00795A",
    PARTIALLY: "#20699E",
    NOT_REPRODUCED: "#C04A00",
    INCONCLUSIVE: "#9A6A00",
    PRECONDITION: "#A2477E",
    NEVER_RUN: "#707070",
}
"""Dark enough for small text on white."""
_MARKS = {MET: ("o", True), NOT_MET: ("X", True), UNCLEAR: ("o", False), TOO_FEW: ("D", False)}
_GAP = 0.8
"""Between the units of one group and the next, in units."""
_HOLDS = "#E3EFE9"
"""Where the criterion holds."""
_SENTENCE, _SMALL, _LABEL = 46, 60, 46
"""Characters a line of sentences, of small print and of axis labels."""
CAPTION = (
    "Verdicts on the paper's claims. Each mark is one judged unit (a cs-reward and a task, source or method): what the "
    "claim's criterion looks at, with its 95 % interval; filled circle: criterion met, cross: not met, open circle: "
    "unclear, open diamond: too few seeds. Shaded: where the criterion holds, up to the black line; a unit is met if "
    "its one-sided 95 % bound lies there (C4, C9: the number itself; its interval within 0.5 in size, or from 0.5 "
    "on), and if the further parts of the criterion hold (success, for example). "
    "Arrow: the interval goes on, or has no finite end. Small triangle: the paper's number, where it prints one (of "
    "unseen tasks their mean); open triangle: its r, which knows nothing of r_task. Units that lack a precondition or "
    "a run are not drawn; the counts include them. Leans: the settings of this study, where they depart from the "
    "paper, favour that side. "
)


def caption() -> str:
    """The caption, with what was fixed beforehand and what was not."""
    return CAPTION + str(load_criteria()["beforehand"]).strip()


@styled
def claims_figure(findings: Sequence[Finding], settings: Settings) -> Figure:
    """One row per claim: the sentence with its verdict in words and colour, and its units on the criterion's scale."""
    drawn = [_shown(finding) for finding in findings]
    heights = [
        max(_text_height(finding), 0.5 + 0.022 * max(len(units), 6))
        for finding, units in zip(findings, drawn, strict=True)
    ]
    figure = new_figure(TEXT_WIDTH, sum(heights))
    figure.get_layout_engine().set(hspace=0.02, h_pad=0.02)  # type: ignore[union-attr, call-arg]
    rows = figure.subplots(len(findings), 2, width_ratios=[1.0, 1.0], height_ratios=heights, squeeze=False)
    for (left, right), finding, units in zip(rows, findings, drawn, strict=True):
        _write_sentence(left, finding)
        _draw_units(right, units, VERDICT_COLOURS[finding.verdict])
    add_notes(figure, scale_notes(settings.scale))
    return figure


def _shown(finding: Finding) -> list[Unit]:
    """Judged units with a number, by cs-reward and measure."""
    hidden = (NOT_RUN, BLOCKED, SHOWN)
    units = [unit for unit in finding.units if unit.state not in hidden and np.isfinite(unit.value.value)]
    order = list(dict.fromkeys(unit.cs_reward for unit in units)), list(dict.fromkeys(unit.measure for unit in units))
    return sorted(units, key=lambda unit: (order[0].index(unit.cs_reward), order[1].index(unit.measure)))


def _sentence(finding: Finding) -> list[str]:
    return textwrap.wrap(finding.text, _SENTENCE, break_on_hyphens=False)


def _small_print(finding: Finding) -> list[str]:
    """The counts behind the verdict, and which way this study's departures lean."""
    leans = " and ".join(dict.fromkeys(leans for leans, _ in finding.departures))
    return textwrap.wrap(finding.reason + (f"; settings lean {leans} it" if leans else ""), _SMALL)


def _text_height(finding: Finding) -> float:
    """Inches that the left panel needs: name, sentence and small print."""
    return 0.22 + 0.115 * len(_sentence(finding)) + 0.095 * len(_small_print(finding))


def _write_sentence(axes: Axes, finding: Finding) -> None:
    """As text within the left panel, from the top down."""
    axes.axis("off")
    colour = VERDICT_COLOURS[finding.verdict]
    name = axes.text(0.0, 1.0, finding.name, va="top", fontsize=8, fontweight="bold", transform=axes.transAxes)
    verdict = f"{finding.verdict} (gate)" if finding.role == "gate" else finding.verdict
    axes.annotate(
        verdict, (1.0, 1.0), xycoords=name, xytext=(5, 0), textcoords="offset points", va="top", fontsize=8,
        fontweight="bold", color=colour, annotation_clip=False,
    )  # fmt: skip
    below = axes.annotate(
        "\n".join(_sentence(finding)), (0.0, 0.0), xycoords=name, xytext=(0, -2), textcoords="offset points", va="top",
        fontsize=7.5, linespacing=1.1, annotation_clip=False,
    )  # fmt: skip
    axes.annotate(
        "\n".join(_small_print(finding)), (0.0, 0.0), xycoords=below, xytext=(0, -2), textcoords="offset points",
        va="top", fontsize=6, color="0.3", linespacing=1.1, annotation_clip=False,
    )  # fmt: skip


def _draw_units(axes: Axes, units: Sequence[Unit], colour: str) -> None:
    axes.grid(axis="y", visible=False)
    axes.spines["left"].set_visible(False)
    axes.tick_params(axis="y", length=0)
    if not units:
        axes.set_xticks([])
        axes.set_yticks([])
        axes.spines["bottom"].set_visible(False)
        return
    heights = _heights(units)
    low, high = _frame(units)
    for height, unit in zip(heights, units, strict=True):
        _draw_unit(axes, height, unit, colour, (low, high))
    axes.set_xlim(low, high)
    axes.set_ylim(heights[-1] + 0.9, heights[0] - 0.9)  # the first unit on top
    measures = list(dict.fromkeys(unit.measure for unit in units))
    axes.set_xlabel("\n".join(_balanced("; ".join(measures), _LABEL)), labelpad=1, fontsize=6)
    groups: dict[str, list[float]] = {}
    for height, unit in zip(heights, units, strict=True):
        groups.setdefault(_group(unit, len(measures) > 1), []).append(height)
    axes.set_yticks([sum(own) / len(own) for own in groups.values()], list(groups), fontsize=6)
    axes.tick_params(axis="x", labelsize=6, pad=1)
    axes.xaxis.set_major_locator(MaxNLocator(5))


def _balanced(text: str, width: int) -> list[str]:
    """In as few lines as ``width`` allows, of about equal length."""
    lines = textwrap.wrap(text, width)
    while width > 1 and len(shorter := textwrap.wrap(text, width - 1)) == len(lines):
        lines, width = shorter, width - 1
    return lines


def _group(unit: Unit, several: bool) -> str:
    """The cs-reward, and of several measures the first word, as in "velocity: success"."""
    return quantity(unit.cs_reward) + (f": {unit.measure.split()[0]}" if several else "")


def _draw_unit(axes: Axes, height: float, unit: Unit, colour: str, frame: tuple[float, float]) -> None:
    marker, filled = _MARKS[unit.state]
    strip = [height - 0.5 - _GAP / 2, height + 0.5 + _GAP / 2]
    axes.fill_betweenx(strip, *np.clip(unit.holds, *frame), color=_HOLDS, linewidth=0, zorder=0)
    for limit in filter(np.isfinite, unit.holds):
        axes.plot([limit, limit], strip, color="black", linewidth=0.8, zorder=1)
    if not np.isnan(unit.value.low):
        _draw_interval(axes, height, Interval(unit.value.low, unit.value.high), colour, frame)
    if np.isfinite(unit.paper_value):
        other = unit.measure == PARTIAL
        axes.plot([unit.paper_value], [height], marker="v", color="0.25", markersize=2.8, zorder=5,
                  markerfacecolor="white" if other else "0.25", markeredgewidth=0.5 if other else 0)  # fmt: skip
    face = colour if filled else "white"
    axes.plot([unit.value.value], [height], marker=marker, color=colour, markerfacecolor=face, markersize=3,
              markeredgewidth=0.7)  # fmt: skip


def _draw_interval(axes: Axes, height: float, interval: Interval, colour: str, frame: tuple[float, float]) -> None:
    """Up to the frame; an arrow there where the interval goes on."""
    axes.plot(np.clip(interval, *frame), [height, height], color=colour, linewidth=0.8)
    for edge, goes_on, marker in (
        (frame[0], interval.low < frame[0], "<"),
        (frame[1], interval.high > frame[1], ">"),
    ):
        if goes_on:
            axes.plot([edge], [height], marker=marker, color=colour, markersize=3, markeredgewidth=0, clip_on=False)


def _heights(units: Sequence[Unit]) -> list[float]:
    """One row per unit, a gap between cs-rewards and between measures."""
    heights: list[float] = []
    for index, unit in enumerate(units):
        before = units[index - 1]
        new = index and (unit.cs_reward, unit.measure) != (before.cs_reward, before.measure)
        heights.append(heights[-1] + 1 + (_GAP if new else 0.0) if heights else 0.0)
    return heights


def _frame(units: Sequence[Unit]) -> tuple[float, float]:
    """Limits of the axis: every value, limit and number of the paper; an interval is cut off half a width away."""
    points = [unit.value.value for unit in units] + [unit.paper_value for unit in units] + [0.0]
    points += [limit for unit in units for limit in unit.holds if np.isfinite(limit)]
    low, high = float(np.nanmin(points)), float(np.nanmax(points))
    width = high - low or 1.0
    ends = [end for unit in units for end in (unit.value.low, unit.value.high) if not np.isnan(end)]
    low, high = (
        min([low, *(max(end, low - width / 2) for end in ends)]),
        max([high, *(min(e, high + width / 2) for e in ends)]),
    )
    return low - 0.05 * (high - low), high + 0.05 * (high - low)
