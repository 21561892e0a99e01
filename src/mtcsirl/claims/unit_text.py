"""One judged unit in words: our number and the paper's, the claim's criterion, and other criteria side by side.

Replication studies report several criteria since none decides alone: whether ours lies where the original predicts a
replication, whether the original lies in our interval, whether the effect differs from nothing, and its size.
"""

import numpy as np

from mtcsirl.claims.judging import Unit
from mtcsirl.claims.scored import PARTIAL
from mtcsirl.results.statistics import Estimate, Interval, Summary

DASH = "–"
COLUMNS = {
    "unit": "unit",
    "judged": "judged",
    "paper": "paper",
    "ours": "ours",
    "measure": "what the criterion looks at",
    "ours_in_prediction": "ours in the paper's prediction interval",
    "paper_in_interval": "paper's in our t-interval",
    "difference": "metric differs from the reference's (Welch)",
    "effect": "Hedges' g of the metric against the reference",
    "why": "why",
    "notes": "beside it",
}
"""Key and heading of each text, in the order in which they are printed."""


def unit_texts(unit: Unit) -> dict[str, str]:
    """The texts of ``COLUMNS``; intervals are 95 %, a dash says that the criterion does not apply."""
    return {
        "unit": f"{unit.cs_reward.replace('_', ' ')}, {unit.what}",
        "judged": f"{unit.state}: {unit.outcome}" if unit.outcome else unit.state,
        "paper": "no number" if np.isnan(unit.paper.mean) else _r(unit) + _spread(unit.paper),
        "ours": _ours(unit),
        "measure": _measure(unit),
        "ours_in_prediction": _prediction(unit),
        "paper_in_interval": _contains(unit.interval, unit.paper.mean),
        "difference": _difference(unit),
        "effect": _effect(unit),
        "why": unit.reason,
        "notes": "; ".join(filter(None, [power_text(unit.power), *unit.notes])) or DASH,
    }


def _ours(unit: Unit) -> str:
    if unit.ours.n == 0:
        return DASH
    success = "" if np.isnan(unit.success.mean) else f", success {100 * unit.success.mean:.0f} %"
    return f"{_r(unit)}{_spread(unit.ours)}, n={unit.ours.n}{success}"


def _r(unit: Unit) -> str:
    """Ours and the paper's number are r itself where the criterion looks at the partial correlation."""
    return "r = " if unit.measure == PARTIAL else ""


def _measure(unit: Unit) -> str:
    """As in "part of SAC's gap closed: 0.84 [0.80, 0.88]; paper 0.83"."""
    if unit.value.n == 0 or np.isnan(unit.value.value):
        return DASH
    paper = "" if np.isnan(unit.paper_value) or unit.measure == PARTIAL else f"; paper {unit.paper_value:.2f}"
    return f"{unit.measure}: {_estimate(unit.value)}{paper}"


def _prediction(unit: Unit) -> str:
    """Whether ours lies in the paper's interval, and whether its spread can be one over seeds like ours."""
    text = _contains(unit.prediction, unit.ours.mean)
    if text == DASH or not unit.spreads.extreme:
        return text
    return f"{text}, uninformative: spreads {unit.paper.std:.2g} and {unit.ours.std:.2g} (F = {unit.spreads.ratio:.3g})"


def power_text(power: float) -> str:
    """Of a test of equivalence; empty where there is none."""
    return "" if np.isnan(power) else f"power {100 * power:.0f} % at these spreads and seeds, were both equal"


def _difference(unit: Unit) -> str:
    test = unit.difference
    if test is None or np.isnan(test.p):
        return DASH
    sure = "yes" if test.p < 0.05 else "no"
    p = "p < 0.001" if test.p < 0.001 else f"p = {test.p:.3f}"
    return f"{unit.reference}: {sure}, {test.difference:+.2f}{_bounds(Interval(test.low, test.high))}, {p}"


def _effect(unit: Unit) -> str:
    if not unit.reference or np.isnan(unit.effect.value):
        return DASH
    closer = "" if np.isnan(unit.closer) else f"; closer with probability {unit.closer:.2f}"
    g = _estimate(unit.effect, 1) if np.isfinite(unit.effect.value) else "infinite (no spread)"
    return f"{g}{closer}"


def _contains(interval: Interval, value: float) -> str:
    """As in "yes [0.61, 0.85]"; a dash where there is no interval or nothing to look for in it."""
    if np.isnan(interval.low) or np.isnan(value):
        return DASH
    return f"{'yes' if interval.contains(value) else 'no'}{_bounds(interval)}"


def _spread(summary: Summary) -> str:
    return f"{summary.mean:.2f}" + ("" if np.isnan(summary.std) else f"±{summary.std:.2f}")


def _estimate(estimate: Estimate, digits: int = 2) -> str:
    return f"{_number(estimate.value, digits)}{_bounds(Interval(estimate.low, estimate.high), digits)}"


def _bounds(interval: Interval, digits: int = 2) -> str:
    if np.isnan(interval.low):
        return ""
    if np.isinf([interval.low, interval.high]).any():
        return " [no finite bounds: SAC's gap is not surely there]"
    return f" [{_number(interval.low, digits)}, {_number(interval.high, digits)}]"


def _number(value: float, digits: int) -> str:
    """What rounds to zero has no sign."""
    return f"{round(value, digits) + 0.0:.{digits}f}"
