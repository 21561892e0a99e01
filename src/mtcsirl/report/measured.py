"""What a claim's criterion looked at, in one line: the first thing that a reader of the page wants beside a verdict."""

from collections.abc import Iterable, Mapping, Sequence
from itertools import groupby
from typing import Any

NOTHING = "nothing measured yet"


def measured(units: Sequence[Mapping[str, Any]]) -> str:
    """The measures of a claim's units as ``claims.json`` has them, with their 95 % intervals.

    One unit per cs-reward: "velocity 0.84 [0.80, 0.88]". Several: the range of their values and the ends of all their
    intervals, "velocity 0.61 to 0.84 [0.52, 0.93], 4 units".
    """
    known = [unit for unit in units if _measure(unit).get("value") is not None]
    if not known:
        return NOTHING
    parts = [
        f"{str(cs_reward).replace('_', ' ')} {_values([_measure(unit) for unit in own])}".strip()
        for cs_reward, own in groupby(known, key=lambda unit: unit.get("cs_reward", ""))
    ]
    names = dict.fromkeys(str(_measure(unit).get("name", "")) for unit in known)
    return f"{'; '.join(filter(None, names))}: {', '.join(parts)}"


def _measure(unit: Mapping[str, Any]) -> Mapping[str, Any]:
    return unit.get("measure") or {}


def _values(measures: Sequence[Mapping[str, Any]]) -> str:
    values = [measure["value"] for measure in measures]
    lows, highs = _numbers(measures, "low"), _numbers(measures, "high")
    span = " to ".join(dict.fromkeys([_number(min(values)), _number(max(values))]))
    interval = f" [{_number(min(lows))}, {_number(max(highs))}]" if lows and highs else ""
    return f"{span}{interval}" + (f" ({len(values)} units)" if len(values) > 1 else "")


def _number(value: float) -> str:
    """Two digits; what rounds to zero has no sign."""
    return f"{round(value, 2) + 0.0:.2f}"


def _numbers(measures: Iterable[Mapping[str, Any]], name: str) -> list[float]:
    return [measure[name] for measure in measures if measure.get(name) is not None]
