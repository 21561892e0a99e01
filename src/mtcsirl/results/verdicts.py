"""The gates of archived runs, made again from the episodes that the archive keeps."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Mapping
from typing import Any

import pandas as pd
from pydantic import ValidationError

from mtcsirl.episodes.evaluation import metrics
from mtcsirl.episodes.gates import gate_verdict, stochastic_means
from mtcsirl.files.identity import Identity
from mtcsirl.names import DIVERGED, KEPT
from mtcsirl.rewards.ground_truth import COMMON_SENSE_REWARDS
from mtcsirl.settings import GateSettings

GATE_OF = {"train_expert": "expert", "train_sac": "sac", "transfer": "sac"}
"""Of the stages with one agent."""
OF_EVERY_STUDY = {"success", "velocity", "action_norm", "task_reward", DIVERGED}
"""Metrics that need no extension."""
DIGITS = 1e-6
"""Rows have nine significant digits, and a gate was made from all of them."""


def faults_of_gate(identity: Identity, files: Mapping[str, bytes], rows: pd.DataFrame | None) -> Iterator[str]:
    """Where ``gate.json`` says something else than follows from the run's episodes and settings, one line.

    Of demonstrations the episodes are not kept: there ``passed`` and the limits must follow from the gate's numbers.
    """
    try:
        said = json.loads(files["gate.json"])
        limits = GateSettings(**json.loads(files["settings.json"])["gates"])
        cs_reward = str(identity.key.get("cs_reward", ""))
        if rows is not None and not _measured(rows, cs_reward):
            return
        wanted = _verdict(identity.stage, said, rows, cs_reward, limits)
        wrong = next((name for name in sorted({*wanted, *said}) if not alike(wanted.get(name), said.get(name))), None)
    except (ValueError, KeyError, TypeError, AttributeError, RecursionError, ValidationError):
        yield "not a readable gate"
        return
    if wrong is not None:
        yield f"{wrong} is {json.dumps(said.get(wrong))[:80]}, which its episodes and settings do not give"


def _measured(rows: pd.DataFrame, cs_reward: str) -> bool:
    """Whether what extensions measure today was measured then, too, and the cs-reward is one of today's."""
    missing = set(metrics()) - set(rows["metric"])
    if cs_reward and cs_reward not in COMMON_SENSE_REWARDS:
        return False
    return not missing or bool(missing & OF_EVERY_STUDY)


def _verdict(stage: str, said: Any, rows: pd.DataFrame | None, cs_reward: str, limits: GateSettings) -> dict[str, Any]:
    if stage == "collect_demonstrations":
        means = {name: _or_nan(said[name]) for name in ("success", "metric")} | {DIVERGED: said["diverged"]}
        return gate_verdict("expert", {**means, cs_reward: means["metric"]}, cs_reward, limits) | {
            "non_finite": said["non_finite"]
        }
    if rows is None:
        raise ValueError("no episodes")
    if stage == "learn_reward":
        return _of_generators(rows, cs_reward, limits)
    return gate_verdict(GATE_OF[stage], _means(rows), cs_reward, limits)


def _of_generators(rows: pd.DataFrame, cs_reward: str, limits: GateSettings) -> dict[str, Any]:
    """As an IRL run sums its generators up: it passes if every generator does."""
    members = [
        {"task": own["task"].iloc[0], "target": int(own["target"].iloc[0])}
        | gate_verdict("generator", _means(own), cs_reward, limits)
        for _, own in rows.groupby(["task", "target"], sort=False)
    ]
    return {
        "gate": "generator",
        "passed": all(member["passed"] for member in members),
        "success": sum(_or_nan(member["success"]) for member in members) / len(members),
        "metric": sum(_or_nan(member["metric"]) for member in members) / len(members),
        "limits": members[0]["limits"],
        "diverged": sum(member["diverged"] for member in members),
        "members": members,
    }


def _means(rows: pd.DataFrame) -> dict[str, float]:
    judged = rows[(rows["policy"] == "stochastic") & (rows["kept"] == KEPT)]
    if OF_EVERY_STUDY - set(judged["metric"]):
        raise ValueError("the episodes that are judged lack a metric")
    return stochastic_means(rows.to_dict("records"))  # type: ignore[arg-type]


def _or_nan(value: float | None) -> float:
    return math.nan if value is None else float(value)


def alike(one: Any, other: Any) -> bool:
    """Equal, numbers up to ``DIGITS``."""
    if isinstance(one, dict) and isinstance(other, dict):
        return one.keys() == other.keys() and all(alike(one[name], other[name]) for name in one)
    if isinstance(one, list) and isinstance(other, list):
        return len(one) == len(other) and all(map(alike, one, other))
    if isinstance(one, float) and isinstance(other, float | int) and not isinstance(other, bool):
        return math.isclose(one, other, rel_tol=DIGITS) or (math.isnan(one) and math.isnan(other))
    return type(one) is type(other) and bool(one == other)
