"""The stage that collects demonstrations: whose expert it is asked for, and what it leaves behind."""

import numpy as np
import pandas as pd
import pytest

from mtcsirl.episodes.evaluation import COLUMNS, evaluate
from mtcsirl.episodes.policy import Policy, save_policy
from mtcsirl.errors import UserError
from mtcsirl.files import storage
from mtcsirl.settings.runs import AgentRunSettings, DemonstrationRunSettings
from mtcsirl.stages.collect_demonstrations import collect_demonstrations
from mtcsirl.study.runs import Demonstrations, Expert

SETTINGS = DemonstrationRunSettings(episodes=2, episode_steps=20)


@pytest.fixture
def expert(tmp_path):
    """The folder of an expert of the velocity on reach-t1, with its evaluation."""
    policy = Policy((np.zeros((8, 39), np.float32),), (np.full(8, -1.0, np.float32),))
    save_policy(policy, tmp_path / "expert")
    settings = AgentRunSettings(evaluation={"episodes": 1, "episode_steps": 20})
    rows = evaluate(policy, "reach", 1, "velocity", 0, settings)
    rows += evaluate(policy, "reach", 1, "velocity", 0, settings, "last")
    storage.write_csv(tmp_path / "expert" / "evaluation.csv", pd.DataFrame(rows, columns=list(COLUMNS)))
    return tmp_path / "expert"


def test_demonstrations_say_whose_they_are_and_their_gate_how_many_diverged(expert, tmp_path):
    asked = Demonstrations(Expert("velocity", "reach", 1, 0))
    collect_demonstrations(SETTINGS, asked, expert, tmp_path / "out")
    frame = storage.read_parquet(tmp_path / "out" / "demonstrations.parquet")
    assert set(frame["cs_reward"]) == {"velocity"}
    gate = storage.read_json(tmp_path / "out" / "gate.json")
    assert (gate["passed"], gate["diverged"], gate["non_finite"]) == (False, 0, [])


@pytest.mark.parametrize("asked", [("reach", 1, "action_norm"), ("push", 1, "velocity"), ("reach", 0, "velocity")])
def test_an_expert_of_something_else_is_refused_before_anything_is_written(expert, tmp_path, asked):
    task, target, cs_reward = asked
    other = Demonstrations(Expert(cs_reward, task, target, 0))
    with pytest.raises(UserError, match="expert: holds an expert of velocity on reach-t1, not an expert of") as error:
        collect_demonstrations(SETTINGS, other, expert, tmp_path / "out")
    assert "\n" not in str(error.value)
    assert not (tmp_path / "out").exists()


def test_a_policy_of_ones_own_says_nothing_and_is_taken(expert, tmp_path):
    (expert / "evaluation.csv").unlink()
    collect_demonstrations(SETTINGS, Demonstrations(Expert("action_norm", "push", 1, 0)), expert, tmp_path / "out")
    assert (tmp_path / "out" / "gate.json").is_file()
