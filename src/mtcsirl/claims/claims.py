"""Verdicts on the paper's claims C1 to C13 by the criteria in ``claims.yaml``."""

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
from mtcsirl.claims.judging import BLOCKED, MET, NOT_MET, NOT_RUN, RUINED, SHOWN, TOO_FEW, UNCLEAR, Unit
from mtcsirl.claims.unit_text import COLUMNS, unit_texts
from mtcsirl.results.published import Published, load_published
from mtcsirl.settings import Settings

REPRODUCED, PARTIALLY, NOT_REPRODUCED = "reproduced", "partially", "not reproduced"
INCONCLUSIVE, PRECONDITION, NEVER_RUN = "inconclusive", "precondition not met", "not run"
VERDICTS = (REPRODUCED, PARTIALLY, NOT_REPRODUCED, INCONCLUSIVE, PRECONDITION, NEVER_RUN)


GATE = "gate"
"""The role of C1 and C2: settings were chosen until they passed, so that passing is no evidence."""


@dataclass(frozen=True)
class Finding:
    """One claim with its verdict and the units that it rests on.

    ``role``: gate or claim; ``departures``: where this study departs from the paper in a way that leans ``for`` or
    ``against`` the claim, as (leans, text).
    """

    name: str
    text: str
    locus: str
    criterion: str
    verdict: str
    reason: str
    units: tuple[Unit, ...]
    role: str = "claim"
    departures: tuple[tuple[str, str], ...] = ()

    @property
    def title(self) -> str:
        """Its name, and that it is a gate if it is."""
        return f"{self.name} (gate)" if self.role == GATE else self.name


@cache
def load_criteria() -> dict[str, Any]:
    """The criteria as shipped with the package."""
    text = resources.files("mtcsirl.claims").joinpath("claims.yaml").read_text(encoding="utf-8")
    criteria: dict[str, Any] = yaml.safe_load(text)
    return criteria


def judge(
    rows: pd.DataFrame,
    scores: pd.DataFrame,
    settings: Settings,
    *,
    points: pd.DataFrame | None = None,
    criteria: Mapping[str, Any] | None = None,
    published: Published | None = None,
) -> list[Finding]:
    """Judge every claim; missing runs are a verdict, not an error.

    Args:
        rows: ``evaluation_rows``; where SAC and experts have two policies, column ``kept`` says which.
        scores: ``score_rows``, for r on every set of transitions.
        settings: of the study.
        points: ``point_rows`` with the column ``agent``, which C4 and C9 are judged on; without them they are not run.
        criteria: other than those shipped.
        published: other numbers of the paper than those shipped.
    """
    criteria = criteria or load_criteria()
    points = pd.DataFrame() if points is None else points
    evidence = Evidence(rows, scores, points, settings, published or load_published())
    common = {name: value for name, value in criteria.items() if name != "claims"}
    return [_judge(name, common | claim, evidence) for name, claim in criteria["claims"].items()]


def _judge(name: str, claim: Mapping[str, Any], evidence: Evidence) -> Finding:
    units = tuple(KINDS[claim["kind"]](evidence, claim))
    verdict, reason = combine([unit.state for unit in units], claim["share"])
    ruined = sum(unit.state == NOT_MET and RUINED in unit.outcome for unit in units)
    reason += f"; {ruined} with ruined agents" if ruined else ""
    if evidence.settings.scale == "smoke" and verdict not in (NEVER_RUN, PRECONDITION):
        verdict, reason = INCONCLUSIVE, f"smoke scale: numbers mean nothing ({reason})"
    departures = tuple((departure["leans"], departure["text"].strip()) for departure in claim.get("departures", ()))
    role = claim.get("role", "claim")
    return Finding(name, claim["text"], claim["locus"], claim["criterion"], verdict, reason, units, role, departures)


def combine(states: Sequence[str], share: float) -> tuple[str, str]:
    """The verdict over units and its reason: the rules at the head of ``claims.yaml``."""
    states = [state for state in states if state != SHOWN]
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
        "beforehand": load_criteria()["beforehand"].strip(),
        "claims": [
            {
                "name": finding.name,
                "role": finding.role,
                "text": finding.text,
                "locus": finding.locus,
                "criterion": finding.criterion,
                "verdict": finding.verdict,
                "reason": finding.reason,
                "departures": [{"leans": leans, "text": text} for leans, text in finding.departures],
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
        "outcome": unit.outcome,
        "reason": unit.reason,
        "measure": {
            "name": unit.measure,
            **_plain(unit.value),
            "unbounded": bool(np.isinf([unit.value.low, unit.value.high]).any()),
            "holds": _plain(unit.holds),
            "published": _number(unit.paper_value),
        },
        "power": _number(unit.power),
        "metric": {**_plain(unit.ours), "t_interval": _plain(unit.interval)},
        "success": _plain(unit.success),
        "reference": {"name": unit.reference, **_plain(unit.reference_summary)},
        "hedges_g": _plain(unit.effect),
        "difference": None if unit.difference is None else _plain(unit.difference),
        "probability_closer_than_reference": _number(unit.closer),
        "published": {
            **_plain(unit.paper),
            "prediction_interval": _plain(unit.prediction),
            "inside": unit.inside,
            "spread_ratio": _plain(unit.spreads),
            "informative": None if unit.inside is None else not unit.spreads.extreme,
        },
        "notes": list(unit.notes),
        "folders": list(unit.folders),
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
        f"{load_criteria()['beforehand'].strip()} Criteria: `claims/claims.yaml`.",
        f"{scale}; {len(settings.seeds)} seeds.",
        "",
        "| Claim | Text | Where | Verdict | Units |",
        "| :-- | :-- | :-- | :-- | :-- |",
    ]
    parts += [f"| {f.title} | {f.text} | {f.locus} | **{f.verdict}** | {f.reason} |" for f in findings]
    for finding in findings:
        parts += ["", f"### {finding.title}: {finding.verdict}", "", f"{finding.text} ({finding.locus})", ""]
        parts += [f"Criterion: {finding.criterion.strip()}.", ""]
        if finding.departures:
            parts += [*(f"- Leans {leans} the claim: {text}." for leans, text in finding.departures), ""]
        if finding.units:
            rows = [COLUMNS, {name: ":--" for name in COLUMNS}, *map(unit_texts, finding.units)]
            parts += ["| " + " | ".join(row[name].replace("|", "\\|") for name in COLUMNS) + " |" for row in rows]
    return "\n".join(parts) + "\n"
