"""Evaluation rows of policies whose behaviour is known, of simulations that diverge and of policies of NaN."""

import numpy as np
import pandas as pd
import pytest
from metaworld.policies import ENV_POLICY_MAP

from mtcsirl.episodes.evaluation import (
    COLUMNS,
    check_agent,
    evaluate,
    evaluated,
    measure_episode,
    metrics,
    run_episode,
)
from mtcsirl.episodes.policy import Policy
from mtcsirl.errors import UserError
from mtcsirl.files.storage import write_csv
from mtcsirl.settings.runs import AgentRunSettings
from mtcsirl.worlds.environments import make_environment

KEY = ("drawer-close", 3, "velocity", 7)


def constant_policy(action, log_std=-3.0, observation="mapped"):
    """Always acts `action` (and noise), whatever it sees."""
    head = np.concatenate((np.arctanh(action), np.full(4, log_std))).astype(np.float32)
    return Policy((np.zeros((8, 39), dtype=np.float32),), (head,), observation=observation)


@pytest.fixture(autouse=True)
def _elsewhere(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)  # MuJoCo writes its log where it runs


@pytest.fixture
def settings():
    return AgentRunSettings(evaluation={"episodes": 3, "episode_steps": 60})


def test_rows(settings):
    rows = pd.DataFrame(evaluate(constant_policy([0.5, -0.5, 0.25, 0.0]), *KEY, settings))
    assert tuple(rows.columns) == COLUMNS
    assert len(rows) == 2 * 3 * 7
    assert tuple(rows["metric"].unique()) == metrics()
    assert set(rows["kept"]) == {"kept"}
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


def test_distance_counts_every_step_on_the_wrong_side():
    """Norms that alternate between 2 and 4 have the mean of a policy on target, and are 1 away at every step."""
    zeros, on_target = np.zeros((6, 39)), np.full((6, 4), 0.75)
    alternating = np.tile([[0.5] * 4, [1.0] * 4], (3, 1))
    far, near = (measure_episode(action, zeros, np.ones(6), True, "raw") for action in (alternating, on_target))
    assert far["action_norm"] == near["action_norm"] == pytest.approx(3.0)
    assert far["action_norm_distance"] == pytest.approx(1.0)
    assert near["action_norm_distance"] == pytest.approx(0.0)
    assert far["velocity_distance"] == pytest.approx(0.8), "the hand does not move"


class Disturbed:
    """A policy beside which the simulation blows up at one step: its actions are finite throughout."""

    def __init__(self, policy, env, step):
        self.policy, self.env, self.left, self.observation = policy, env, step, policy.observation

    def act(self, observation, generator=None):
        if self.left == 0:
            self.env.simulator.data.qvel[:] = 1e12
        self.left -= 1
        return self.policy.act(observation, generator)


def test_a_simulation_that_diverges_is_a_failed_episode_measured_before_that():
    policy, env = constant_policy([0.5, -0.5, 0.25, 0.0]), make_environment("reach", 0)
    whole = run_episode(policy, env, 20, None)
    cut = run_episode(Disturbed(policy, env, 20), env, 60, None)
    assert (whole["diverged"], cut["diverged"]) == (0.0, 1.0)
    assert {name: value for name, value in cut.items() if name != "diverged"} == {
        name: value for name, value in whole.items() if name != "diverged"
    }
    assert all(np.isfinite(list(cut.values())))


class Shutting:
    """Meta-World's hand-written policy for the drawer."""

    observation = "raw"

    def __init__(self):
        self.script = ENV_POLICY_MAP["drawer-close-v3"]()

    def act(self, observation, generator=None):
        return np.clip(self.script.get_action(observation.astype(np.float64)), -1, 1).astype(np.float32)


def test_success_before_the_simulation_diverged_does_not_count():
    env = make_environment("drawer-close", 0, observation="raw")
    whole, cut = (run_episode(policy, env, 200, None) for policy in (Shutting(), Disturbed(Shutting(), env, 190)))
    assert (whole["success"], whole["diverged"]) == (1.0, 0.0)
    assert (cut["success"], cut["diverged"]) == (0.0, 1.0)


def test_the_first_step_diverging_leaves_nothing_to_measure():
    env = make_environment("reach", 0)
    with pytest.raises(UserError, match="diverged at the first step"):
        run_episode(Disturbed(constant_policy([0.1] * 4), env, 0), env, 60, None)


def test_a_policy_of_nan_is_refused_by_name_where_it_would_have_closed_the_drawer(settings):
    """MuJoCo resets itself at every NaN and the arm falls on the drawer: success 1.0 without a policy."""
    broken = constant_policy([np.nan] * 4)
    with pytest.raises(UserError, match=r"policy of drawer-close-t3, seed 7: step 0: .*nan.* not finite") as error:
        evaluate(broken, *KEY, settings)
    assert "\n" not in str(error.value)
    env = make_environment("drawer-close", 3)
    env.reset()
    fallen = [env.step(np.full(4, np.nan))[4] for _ in range(60)]
    assert any(info["success"] for info in fallen), "what the check is for"
    evaluate(constant_policy([0.1] * 4), *KEY, settings)


def test_the_last_policy_has_rows_of_its_own_with_the_same_random_numbers(settings):
    policy = constant_policy([0.1, 0.1, 0.1, 0.1])
    kept, last = evaluate(policy, *KEY, settings), evaluate(policy, *KEY, settings, "last")
    assert {row["kept"] for row in last} == {"last"}
    assert [row | {"kept": "kept"} for row in last] == kept


def test_a_folder_says_whose_evaluation_it_holds(settings, tmp_path):
    rows = pd.DataFrame(evaluate(constant_policy([0.1] * 4), *KEY, settings), columns=list(COLUMNS))
    assert evaluated(tmp_path) is None
    check_agent(tmp_path, "reach", 0, "action_norm")  # a policy of one's own says nothing
    write_csv(tmp_path / "evaluation.csv", rows)
    assert evaluated(tmp_path) == KEY
    check_agent(tmp_path, *KEY[:3])
    for other in (("reach", 3, "velocity"), ("drawer-close", 0, "velocity"), ("drawer-close", 3, "action_norm")):
        with pytest.raises(UserError, match="holds an expert of velocity on drawer-close-t3, not"):
            check_agent(tmp_path, *other)
    write_csv(tmp_path / "evaluation.csv", pd.concat([rows, rows.assign(seed=8)]))
    with pytest.raises(UserError, match="holds 2 agents"):
        evaluated(tmp_path)
