"""Evaluation rows of a policy whose behaviour is known, and the gates."""

import numpy as np
import pandas as pd
import pytest

from mtcsirl.episodes.evaluation import (
    COLUMNS,
    evaluate,
    gate_verdict,
    measure_episode,
    relative_distance,
    run_episode,
    stochastic_means,
)
from mtcsirl.episodes.policy import Policy
from mtcsirl.settings import GateSettings
from mtcsirl.settings.runs import AgentRunSettings
from mtcsirl.worlds.environments import make_environment

KEY = ("drawer-close", 3, "velocity", 7)


def constant_policy(action, log_std=-3.0, observation="mapped"):
    """Always acts `action` (and noise), whatever it sees."""
    head = np.concatenate((np.arctanh(action), np.full(4, log_std))).astype(np.float32)
    return Policy((np.zeros((8, 39), dtype=np.float32),), (head,), observation=observation)


@pytest.fixture
def settings():
    return AgentRunSettings(evaluation={"episodes": 3, "episode_steps": 60})


def test_rows(settings):
    rows = pd.DataFrame(evaluate(constant_policy([0.5, -0.5, 0.25, 0.0]), *KEY, settings))
    assert tuple(rows.columns) == COLUMNS
    assert len(rows) == 2 * 3 * 4
    assert rows[["task", "target", "cs_reward", "seed"]].drop_duplicates().values.tolist() == [list(KEY)]
    pivot = rows.pivot_table(index=["policy", "episode"], columns="metric", values="value")
    assert pivot.loc["deterministic"].nunique().max() == 1
    assert pivot.loc["stochastic", "action_norm"].nunique() == 3
    assert pivot.loc["deterministic", "action_norm"].iloc[0] == pytest.approx(1.25, abs=1e-6)
    assert pivot["task_reward"].between(0, 10).all()
    assert set(pivot["success"]) <= {0.0, 1.0}


def test_same_seed_same_rows_and_another_seed_others(settings):
    policy = constant_policy([0.1, 0.1, 0.1, 0.1])
    assert evaluate(policy, *KEY, settings) == evaluate(policy, *KEY, settings)
    assert evaluate(policy, *KEY, settings) != evaluate(policy, *KEY[:3], 8, settings)


@pytest.mark.parametrize("observation", ["mapped", "raw"])
def test_velocity_is_the_hands_displacement_over_the_time_step(observation):
    policy = constant_policy([0.0, 0.9, 0.2, 0.0], observation=observation)
    env = make_environment("reach", 0, observation=observation)
    measured = run_episode(policy, env, 40, None)
    raw = make_environment("reach", 0, observation="raw")
    hand, speeds = raw.reset()[0][:3].astype(np.float64), []
    for _ in range(40):
        following = raw.step(np.array([0.0, 0.9, 0.2, 0.0], dtype=np.float32))[0][:3].astype(np.float64)
        speeds.append(np.linalg.norm(following - hand) / 0.0125)
        hand = following
    assert measured["velocity"] == pytest.approx(np.mean(speeds), abs=1e-4)
    assert measured["velocity"] > 0.1


def test_success_at_any_step_counts():
    zeros = np.zeros((5, 39))
    assert measure_episode(np.zeros((5, 4)), zeros, np.ones(5), True, "raw")["success"] == 1.0
    assert measure_episode(np.zeros((5, 4)), zeros, np.ones(5), False, "raw")["success"] == 0.0


def test_episode_ends_with_the_environment():
    env = make_environment("reach", 0)
    run_episode(constant_policy([0.0, 0.0, 0.0, 0.0]), env, 10_000, None)


def test_stochastic_means_leave_the_deterministic_episodes_out():
    rows = [
        {"policy": policy, "metric": metric, "value": value}
        for metric in ("success", "velocity", "action_norm", "task_reward")
        for policy, value in (("stochastic", 1.0), ("stochastic", 2.0), ("deterministic", 30.0))
    ]
    assert stochastic_means(rows) == dict.fromkeys(("success", "velocity", "action_norm", "task_reward"), 1.5)


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
    means = {"success": success, "velocity": velocity, "action_norm": 1.0, "task_reward": 5.0}
    verdict = gate_verdict(gate, means, "velocity", GateSettings())
    assert set(verdict) == {"gate", "passed", "success", "metric", "limits"}
    assert verdict["passed"] is passed
    assert verdict["metric"] == (None if gate == "sac" else velocity)


def test_action_norm_has_its_own_limit():
    means = {"success": 1.0, "velocity": 0.8, "action_norm": 3.14, "task_reward": 5.0}
    assert gate_verdict("expert", means, "action_norm", GateSettings())["passed"]
    assert not gate_verdict("expert", means | {"action_norm": 3.16}, "action_norm", GateSettings())["passed"]
    assert relative_distance(3.3, "action_norm") == pytest.approx(0.1)


def test_unknown_gate_is_an_error():
    with pytest.raises(ValueError, match="unknown gate"):
        gate_verdict("door", {"success": 1.0}, "velocity", GateSettings())
