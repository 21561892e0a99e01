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

from mtcsirl.claims.criteria import KINDS
from mtcsirl.claims.evidence import Evidence
from mtcsirl.claims.judging import BLOCKED, MET, NOT_MET, NOT_RUN, TOO_FEW, UNCLEAR, Unit
from mtcsirl.claims.unit_text import COLUMNS, unit_texts
from mtcsirl.results.published import Published, load_published
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
    return yaml.safe_load(resources.files("mtcsirl.claims").joinpath("claims.yaml").read_text(encoding="utf-8"))


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
    """The texts for people, then every number."""
    return {
        "texts": unit_texts(unit),
        "cs_reward": unit.cs_reward,
        "answer": unit.state,
        "reason": unit.reason,
        "measure": {"name": unit.measure, **_plain(unit.value), "published": _number(unit.paper_value)},
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


def claims_markdown(findings: Sequence[Finding], settings: Settings) -> str:
    """One table of verdicts, then one table of units per claim."""
    scale = "smoke scale: numbers mean nothing" if settings.scale == "smoke" else f"scale {settings.scale}"
    parts = [
        f"Criteria were fixed beforehand in `claims/claims.yaml`. {scale}; {len(settings.seeds)} seeds.",
        "",
        "| Claim | Text | Where | Verdict | Units |",
        "| :-- | :-- | :-- | :-- | :-- |",
    ]
    parts += [f"| {f.name} | {f.text} | {f.locus} | **{f.verdict}** | {f.reason} |" for f in findings]
    for finding in findings:
        parts += ["", f"### {finding.name}: {finding.verdict}", "", f"{finding.text} ({finding.locus})", ""]
        parts += [f"Criterion: {finding.criterion.strip()}.", ""]
        if finding.units:
            rows = [COLUMNS, {name: ":--" for name in COLUMNS}, *map(unit_texts, finding.units)]
            parts += ["| " + " | ".join(row[name] for name in COLUMNS) + " |" for row in rows]
    return "\n".join(parts) + "\n"
