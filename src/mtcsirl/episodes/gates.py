"""What an agent must reach to count as having learned; an agent below its gate is marked, never dropped."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from mtcsirl.episodes.evaluation import Row, metrics
from mtcsirl.names import DIVERGED, KEPT
from mtcsirl.rewards.ground_truth import COMMON_SENSE_REWARDS
from mtcsirl.settings import GateSettings

GATES = ("expert", "generator", "sac")


def stochastic_means(rows: Sequence[Row]) -> dict[str, float]:
    """The mean of each metric over the stochastic episodes of the kept policy; of ``diverged`` the number of episodes.

    One episode whose metric is no number makes the mean none: such a mean never passes a gate.
    """
    chosen = [row for row in rows if row["policy"] == "stochastic" and row["kept"] == KEPT]
    means = {
        metric: float(np.mean([row["value"] for row in chosen if row["metric"] == metric])) for metric in metrics()
    }
    return means | {DIVERGED: float(sum(row["value"] for row in chosen if row["metric"] == DIVERGED))}


def gate_verdict(gate: str, means: Mapping[str, float], cs_reward: str, limits: GateSettings) -> dict[str, Any]:
    """The content of ``gate.json``: whether an agent learned what it should have.

    gate: "expert" and "generator" ask for success and for the cs-reward's metric near its target, "sac" for success
    alone. ``means``: as ``stochastic_means`` gives them. ``diverged`` says in how many of the episodes the simulation
    diverged (each counts as failed), ``non_finite`` which of the means are no numbers: with one the agent fails.
    """
    if gate not in GATES:
        raise ValueError(f"unknown gate {gate!r}")
    non_finite = sorted(name for name, value in means.items() if not math.isfinite(value))
    asked: dict[str, float] = {"success": limits.success}
    passed = not non_finite and means["success"] >= limits.success
    metric = None
    if gate != "sac":
        metric = means[cs_reward]
        asked["relative_distance"] = metric_limit(gate, cs_reward, limits)
        passed = passed and relative_distance(metric, cs_reward) <= asked["relative_distance"]
    return {
        "gate": gate,
        "passed": bool(passed),
        "success": _number(means["success"]),
        "metric": _number(metric),
        "limits": asked,
        "diverged": int(means[DIVERGED]),
        "non_finite": non_finite,
    }


def _number(value: float | None) -> float | None:
    """``value``, or None for what JSON has no number for."""
    return value if value is not None and math.isfinite(value) else None


def relative_distance(metric: float, cs_reward: str) -> float:
    """|metric - target| / target of a cs-reward."""
    target = COMMON_SENSE_REWARDS[cs_reward].target
    return abs(metric - target) / target


def metric_limit(gate: str, cs_reward: str, limits: GateSettings) -> float:
    """The largest relative distance to the target that passes; cs-rewards without a limit of their own take 0.15."""
    if gate == "generator":
        return limits.generator
    return float(getattr(limits, f"expert_{cs_reward}", limits.expert_velocity))
