"""Verdicts on the paper's claims C1 to C12 by the criteria in ``claims.yaml``."""

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from importlib import resources
from typing import Any

import numpy as np
import pandas as pd
import yaml

from mtcsirl.analysis.criteria import KINDS
from mtcsirl.analysis.evidence import Evidence
from mtcsirl.analysis.judging import BLOCKED, MET, NOT_MET, NOT_RUN, TOO_FEW, UNCLEAR, Unit
from mtcsirl.published import Published, load_published
from mtcsirl.settings import Settings

REPRODUCED, PARTIALLY, NOT_REPRODUCED = "reproduced", "partially", "not reproduced"
INCONCLUSIVE, PRECONDITION, NEVER_RUN = "inconclusive", "precondition not met", "not run"
VERDICTS = (REPRODUCED, PARTIALLY, NOT_REPRODUCED, INCONCLUSIVE, PRECONDITION, NEVER_RUN)


@dataclass(frozen=True)
class Finding:
    """One claim with its verdict and the units that it rests on."""

    name: str
    text: str
    locus: str
    criterion: str
    verdict: str
    reason: str
    units: tuple[Unit, ...]


@cache
def load_criteria() -> dict[str, Any]:
    """The criteria as shipped with the package."""
    return yaml.safe_load(resources.files("mtcsirl.analysis").joinpath("claims.yaml").read_text(encoding="utf-8"))


def judge(
    rows: pd.DataFrame,
    scores: pd.DataFrame,
    settings: Settings,
    criteria: Mapping[str, Any] | None = None,
    published: Published | None = None,
) -> list[Finding]:
    """Judge every claim on ``evaluation_rows`` and ``score_rows``; missing runs are a verdict, not an error."""
    criteria = criteria or load_criteria()
    evidence = Evidence(rows, scores, settings, published or load_published())
    common = {name: value for name, value in criteria.items() if name != "claims"}
    return [_judge(name, common | claim, evidence) for name, claim in criteria["claims"].items()]


def _judge(name: str, claim: Mapping[str, Any], evidence: Evidence) -> Finding:
    units = tuple(KINDS[claim["kind"]](evidence, claim))
    verdict, reason = combine([unit.state for unit in units], claim["share"])
    if evidence.settings.scale == "smoke" and verdict not in (NEVER_RUN, PRECONDITION):
        verdict, reason = INCONCLUSIVE, f"smoke scale: numbers mean nothing ({reason})"
    return Finding(name, claim["text"], claim["locus"], claim["criterion"], verdict, reason, units)


def combine(states: Sequence[str], share: float) -> tuple[str, str]:
    """The verdict over units and its reason: the rules at the head of ``claims.yaml``."""
    total, count = len(states), Counter(states)
    reason = ", ".join(f"{count[s]} {s}" for s in (MET, NOT_MET, UNCLEAR, TOO_FEW, BLOCKED, NOT_RUN) if count[s]) + (
        f" of {total} units" if total else ""
    )
    if total == 0:
        return NEVER_RUN, "the study has no such runs"
    # Shares of few units: 1 - 0.8 is a little less than 0.2 in floating point.
    spared, needed = (1 - share) * total + 1e-9, share * total - 1e-9
    if count[NOT_RUN] > spared:
        return NEVER_RUN, reason
    if count[BLOCKED] > spared:
        return PRECONDITION, reason
    met = count[MET]
    if met >= needed:
        return REPRODUCED, reason
    if met + (total - met - count[NOT_MET]) >= needed:
        return INCONCLUSIVE, reason
    return (PARTIALLY if met else NOT_REPRODUCED), reason


def claims_json(findings: Sequence[Finding], settings: Settings) -> dict[str, Any]:
    """All findings as plain data; unknown numbers are null."""
    return {
        "scale": settings.scale,
        "seeds": list(settings.seeds),
        "claims": [
            {
                "name": finding.name,
                "text": finding.text,
                "locus": finding.locus,
                "criterion": finding.criterion,
                "verdict": finding.verdict,
                "reason": finding.reason,
                "units": [_unit_json(unit) for unit in finding.units],
            }
            for finding in findings
        ],
    }


def _unit_json(unit: Unit) -> dict[str, Any]:
    """Three texts for people, then every number."""
    return {
        "unit": unit_name(unit),
        "paper": paper_text(unit),
        "ours": ours_text(unit),
        "answer": unit.state,
        "reason": unit.reason,
        "cs_reward": unit.cs_reward,
        "measure": {"name": unit.measure, **_plain(unit.value)},
        "metric": {**_plain(unit.ours), "t_interval": _plain(unit.interval)},
        "success": _plain(unit.success),
        "reference": {"name": unit.reference, **_plain(unit.reference_summary)},
        "hedges_g": _plain(unit.effect),
        "difference": None if unit.difference is None else _plain(unit.difference),
        "probability_closer_than_reference": _number(unit.closer),
        "published": {**_plain(unit.paper), "prediction_interval": _plain(unit.prediction), "inside": unit.inside},
    }


def _plain(numbers: Any) -> dict[str, Any]:
    return {name: _number(value) for name, value in numbers._asdict().items()}


def _number(value: float) -> float | int | None:
    if isinstance(value, int):
        return value
    return round(float(value), 6) if np.isfinite(value) else None


def unit_name(unit: Unit) -> str:
    """As in "velocity, reach-wall"."""
    return f"{unit.cs_reward.replace('_', ' ')}, {unit.what}"


def ours_text(unit: Unit) -> str:
    """The metric over seeds and the measure of the criterion, in one line."""
    if unit.value.n == 0 and unit.ours.n == 0:
        return "–"
    metric = f"{unit.ours.mean:.2f}{_plus_minus(unit.ours.std)} (n={unit.ours.n})"
    if unit.measure.startswith("Pearson"):
        return f"r = {unit.value.value:.2f}{_bounds(unit.value.low, unit.value.high)} (n={unit.value.n})"
    success = "" if np.isnan(unit.success.mean) else f", success {100 * unit.success.mean:.0f} %"
    measure = f"{unit.measure} {unit.value.value:.2f}{_bounds(unit.value.low, unit.value.high)}"
    return f"{metric}{success}; {measure}{_effect(unit)}"


def paper_text(unit: Unit) -> str:
    """The paper's number and its prediction interval, where it prints them."""
    if np.isnan(unit.paper.mean):
        return "no number"
    inside = {None: "", True: " (ours inside)", False: " (ours outside)"}[unit.inside]
    interval = _bounds(unit.prediction.low, unit.prediction.high) + inside
    return f"{unit.paper.mean:.2f}{_plus_minus(unit.paper.std)}{interval}"


def _effect(unit: Unit) -> str:
    if not unit.reference or np.isnan(unit.effect.value):
        return ""
    g = f"{unit.effect.value:.1f}" if np.isfinite(unit.effect.value) else "infinite"
    closer = "" if np.isnan(unit.closer) else f", closer with probability {unit.closer:.2f}"
    return f"; against {unit.reference}: g = {g}{_bounds(unit.effect.low, unit.effect.high, 1)}{closer}"


def _plus_minus(std: float) -> str:
    return "" if np.isnan(std) else f"±{std:.2f}"


def _bounds(low: float, high: float, digits: int = 2) -> str:
    return "" if np.isnan(low) else f" [{low:.{digits}f}, {high:.{digits}f}]"


def claims_markdown(findings: Sequence[Finding], settings: Settings) -> str:
    """One table of verdicts, then one table of units per claim."""
    scale = "smoke scale: numbers mean nothing" if settings.scale == "smoke" else f"scale {settings.scale}"
    parts = [
        f"Criteria were fixed beforehand in `analysis/claims.yaml`. {scale}; {len(settings.seeds)} seeds.",
        "",
        "| Claim | Text | Where | Verdict | Units |",
        "| :-- | :-- | :-- | :-- | :-- |",
    ]
    parts += [f"| {f.name} | {f.text} | {f.locus} | **{f.verdict}** | {f.reason} |" for f in findings]
    for finding in findings:
        parts += ["", f"### {finding.name}: {finding.verdict}", "", f"{finding.text} ({finding.locus})", ""]
        parts += [f"Criterion: {finding.criterion.strip()}.", ""]
        if finding.units:
            parts += ["| Unit | Paper | Ours | Judged | Why |", "| :-- | :-- | :-- | :-- | :-- |"]
            parts += [
                f"| {unit_name(u)} | {paper_text(u)} | {ours_text(u)} | {u.state} | {u.reason} |" for u in finding.units
            ]
    return "\n".join(parts) + "\n"
