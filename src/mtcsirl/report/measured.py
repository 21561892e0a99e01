"""What a claim's criterion looked at, in one line: the first thing that a reader of the page wants beside a verdict."""

from collections.abc import Mapping, Sequence
from typing import Any

from mtcsirl.claims.judging import BLOCKED, SHOWN

NOTHING = "nothing measured yet"
UNBOUNDED = "no finite bounds"
"""Of Fieller's set where SAC's gap is not surely there: every part of it is possible."""


def measured(units: Sequence[Mapping[str, Any]]) -> str:
    """The measures of a claim's units as ``claims.json`` has them, with their 95 % intervals.

    One unit per cs-reward: "velocity 0.84 [0.80, 0.88]". Several: the range of their values and the ends of all their
    intervals, "velocity 0.61 to 0.84 [0.52, 0.93] (4 units)". Measures are told apart; intervals without finite ends
    are said in words; units that were not judged count nowhere, those that lack a precondition are only counted.
    """
    parts: dict[str, dict[str, list[Mapping[str, Any]]]] = {}
    blocked = sum(unit.get("answer") == BLOCKED for unit in units)
    for unit in units:
        measure = unit.get("measure") or {}
        if unit.get("answer") not in (SHOWN, BLOCKED) and measure.get("value") is not None:
            own = parts.setdefault(str(measure.get("name", "")), {})
            own.setdefault(str(unit.get("cs_reward", "")).replace("_", " "), []).append(measure)
    told = [f"{name}: {_by_cs_reward(own)}" for name, own in parts.items()]
    if blocked:
        told.append(f"{blocked} {'unit lacks its' if blocked == 1 else 'units lack their'} precondition")
    return "; ".join(told) or NOTHING


def _by_cs_reward(groups: Mapping[str, Sequence[Mapping[str, Any]]]) -> str:
    return ", ".join(f"{cs_reward} {_values(measures)}".strip() for cs_reward, measures in groups.items())


def _values(measures: Sequence[Mapping[str, Any]]) -> str:
    values = [measure["value"] for measure in measures]
    span = " to ".join(dict.fromkeys([_number(min(values)), _number(max(values))]))
    return f"{span}{_interval(measures)}" + (f" ({len(values)} units)" if len(values) > 1 else "")


def _interval(measures: Sequence[Mapping[str, Any]]) -> str:
    """The ends of all intervals, in brackets; how many have none."""
    lows, highs = ([m[name] for m in measures if m.get(name) is not None] for name in ("low", "high"))
    bounds = [f"{_number(min(lows))}, {_number(max(highs))}"] if lows and highs else []
    unbounded = sum(bool(measure.get("unbounded")) for measure in measures)
    if unbounded:
        bounds.append(UNBOUNDED if unbounded == len(measures) else f"{UNBOUNDED} for {unbounded}")
    return f" [{'; '.join(bounds)}]" if bounds else ""


def _number(value: float) -> str:
    """Two digits; what rounds to zero has no sign."""
    return f"{round(value, 2) + 0.0:.2f}"
