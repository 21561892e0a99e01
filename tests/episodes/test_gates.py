"""What passes a gate and what does not: limits, means that are no numbers, episodes that diverged."""

import numpy as np
import pytest

from mtcsirl.episodes.evaluation import metrics
from mtcsirl.episodes.gates import gate_verdict, relative_distance, stochastic_means
from mtcsirl.settings import GateSettings

MEANS = {"success": 1.0, "velocity": 0.8, "action_norm": 1.0, "task_reward": 5.0, "diverged": 0.0}


def _rows(metric, stochastic, *, deterministic=30.0, last=40.0):
    kinds = [("stochastic", "kept", value) for value in stochastic]
    kinds += [("deterministic", "kept", deterministic), ("stochastic", "last", last)]
    return [{"policy": policy, "kept": kept, "metric": metric, "value": value} for policy, kept, value in kinds]


def test_stochastic_means_are_those_of_the_kept_policys_stochastic_episodes():
    rows = [row for metric in metrics() for row in _rows(metric, (0.0, 1.0))]
    assert stochastic_means(rows) == dict.fromkeys(metrics(), 0.5) | {"diverged": 1.0}


def test_a_mean_over_a_nan_is_one():
    rows = [row for metric in metrics() for row in _rows(metric, (0.0, np.nan if metric == "velocity" else 1.0))]
    assert np.isnan(stochastic_means(rows)["velocity"])
    assert np.isfinite(stochastic_means(rows)["action_norm"])


@pytest.mark.parametrize(
    ("gate", "success", "velocity", "passed"),
    [
        ("expert", 0.9, 0.69, True),
        ("expert", 0.89, 0.8, False),
        ("expert", 1.0, 0.67, False),
        ("expert", 1.0, 0.93, False),
        ("generator", 1.0, 0.61, True),
        ("generator", 1.0, 0.59, False),
        ("sac", 0.9, 0.0, True),
        ("sac", 0.8, 0.8, False),
    ],
)
def test_gates(gate, success, velocity, passed):
    verdict = gate_verdict(gate, MEANS | {"success": success, "velocity": velocity}, "velocity", GateSettings())
    assert set(verdict) == {"gate", "passed", "success", "metric", "limits", "diverged", "non_finite"}
    assert verdict["passed"] is passed
    assert verdict["metric"] == (None if gate == "sac" else velocity)
    assert (verdict["diverged"], verdict["non_finite"]) == (0, [])


@pytest.mark.parametrize("gate", ["expert", "generator", "sac"])
@pytest.mark.parametrize("value", [np.nan, np.inf])
@pytest.mark.parametrize("name", ["success", "velocity", "task_reward"])
def test_means_that_are_no_numbers_never_pass(gate, name, value):
    assert gate_verdict(gate, MEANS, "velocity", GateSettings())["passed"]
    verdict = gate_verdict(gate, MEANS | {name: value}, "velocity", GateSettings())
    assert verdict["passed"] is False
    assert verdict["non_finite"] == [name]
    assert verdict["success"] is None or np.isfinite(verdict["success"])


def test_diverged_episodes_are_counted():
    assert gate_verdict("sac", MEANS | {"success": 0.9, "diverged": 1.0}, "", GateSettings())["diverged"] == 1


def test_action_norm_has_its_own_limit():
    means = MEANS | {"action_norm": 3.14}
    assert gate_verdict("expert", means, "action_norm", GateSettings())["passed"]
    assert not gate_verdict("expert", means | {"action_norm": 3.16}, "action_norm", GateSettings())["passed"]
    assert relative_distance(3.3, "action_norm") == pytest.approx(0.1)


def test_unknown_gate_is_an_error():
    with pytest.raises(ValueError, match="unknown gate"):
        gate_verdict("door", MEANS, "velocity", GateSettings())
