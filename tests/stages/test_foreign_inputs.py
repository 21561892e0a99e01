"""Inputs that no stage wrote end in one line before the stage begins; what they are like is taken."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from mtcsirl.cli import main
from mtcsirl.episodes.demonstrations import COLUMNS as OF_DEMONSTRATIONS
from mtcsirl.episodes.policy import Policy, save_policy
from mtcsirl.errors import UserError
from mtcsirl.files import storage
from mtcsirl.study.inputs import check_demonstrations, check_evaluation
from tests.words import learn_reward

KEY = ["--cs-reward", "velocity", "--task", "reach", "--target", "1", "--seed", "0", "--scale", "smoke"]


def _one_line(capsys: pytest.CaptureFixture[str]) -> str:
    error = capsys.readouterr().err
    assert error.count("\n") == 1, error
    assert error.startswith("mtcsirl: ")
    assert "bug" not in error
    return error


def _evaluated(folder: Path, cs_reward: str = "velocity", **changes: object) -> Path:
    """A policy and the evaluation of its one episode."""
    save_policy(Policy((np.zeros((8, 39), np.float32),), (np.full(8, -1.0, np.float32),)), folder)
    row = {"task": "reach", "target": 1, "cs_reward": cs_reward, "seed": 0, "policy": "stochastic", "kept": "kept"}
    row |= {"episode": 0, "metric": "success", "value": 1.0}
    storage.write_csv(folder / "evaluation.csv", pd.DataFrame([row | changes]))
    return folder


NO_AGENTS = {
    "a blank seed": ({"seed": None}, "column seed holds 'nan', not a whole number"),
    "half a seed": ({"seed": 0.5}, "column seed holds '0.5', not a whole number"),
    "no end": ({"seed": np.inf}, "column seed holds 'inf', not a whole number"),
    "a seed below 0": ({"seed": -1}, "column seed holds '-1', not a whole number"),
    "a blank target": ({"target": None}, "column target holds 'nan', not a whole number"),
    "half more than its target": ({"target": 1.5}, "column target holds '1.5', not a whole number"),
}


@pytest.mark.parametrize("what", NO_AGENTS)
def test_an_expert_whose_evaluation_names_no_agent(
    tmp_path: Path, what: str, capsys: pytest.CaptureFixture[str]
) -> None:
    changes, says = NO_AGENTS[what]
    expert, output = _evaluated(tmp_path / "expert", **changes), tmp_path / "out"
    words = ["collect-demonstrations", *KEY, "--expert", str(expert), "--output", str(output)]
    assert main(words) == 2
    assert f"{expert / 'evaluation.csv'}: {says}" in _one_line(capsys)
    assert not output.exists()
    _evaluated(expert, seed="0.0")
    assert main(words) == 0, "a number as a column with gaps has it is one"


@pytest.mark.parametrize("role", ["expert", "baseline"])
def test_scores_want_agents_too(tmp_path: Path, role: str, capsys: pytest.CaptureFixture[str]) -> None:
    expert, baseline = _evaluated(tmp_path / "expert"), _evaluated(tmp_path / "baseline", cs_reward="")
    (tmp_path / "reward").mkdir()
    words = ["score-reward", *KEY, "--reward", str(tmp_path / "reward"), "--output", str(tmp_path / "out")]
    words += ["--expert", str(expert), "--baseline", str(baseline)]
    assert main(words) == 2
    assert "reward" in _one_line(capsys), "both evaluations are agents'; the reward is not there"
    _evaluated(tmp_path / role, cs_reward="velocity" if role == "expert" else "", seed=None)
    assert main(words) == 2
    assert f"{tmp_path / role / 'evaluation.csv'}: column seed holds 'nan'" in _one_line(capsys)
    assert not (tmp_path / "out").exists()


def test_what_is_no_evaluation_is_left_to_others(tmp_path: Path) -> None:
    check_evaluation(tmp_path)
    _evaluated(tmp_path / "expert")
    check_evaluation(tmp_path / "expert")


NO_DEMONSTRATIONS = {
    "a target that is no number": ({"target": np.nan}, "column target holds 'nan', not a target (0 ... 49)"),
    "a target that is a text": ({"target": "x"}, "column target holds 'x', not a target"),
    "a number that is a text": ({"target": "1"}, "column target holds '1', not a target"),
    "half a target": ({"target": 0.5}, "column target holds '0.5', not a target"),
    "a target that is true": ({"target": True}, "column target holds 'True', not a target"),
    "a target that is a list": ({"target": [[1]]}, "column target holds '[1"),
    "a target too many": ({"target": 50}, "column target holds '50', not a target"),
    "no task": ({"task": None}, "column task holds 'None', not a task of Meta-World"),
    "an unknown task": ({"task": "fly"}, "column task holds 'fly', not a task of Meta-World"),
    "an episode that is a text": ({"episode": "0"}, "column episode holds '0', not a whole number"),
    "an episode below 0": ({"episode": -1}, "column episode holds '-1', not a whole number"),
    "a step that is a text": ({"step": "0"}, "column step holds '0', not a whole number"),
    "a cs-reward that is null": ({"cs_reward": None}, "column cs_reward holds 'None', not a name"),
    "a cs-reward that is no number": ({"cs_reward": np.nan}, "column cs_reward holds 'nan', not a name"),
}
ROW = dict.fromkeys(OF_DEMONSTRATIONS, 0.0) | {"task": "reach", "target": 1, "cs_reward": "velocity"}


@pytest.fixture
def file(tmp_path: Path) -> Path:
    """Where demonstrations are expected."""
    return tmp_path / "demonstrations.parquet"


def _write(file: Path, **changes: object) -> None:
    """One transition, with some of its values others."""
    lists = {name: value if isinstance(value, list) else [value] for name, value in (ROW | changes).items()}
    storage.write_parquet(file, pd.DataFrame(lists))


@pytest.mark.parametrize("what", NO_DEMONSTRATIONS)
def test_demonstrations_that_name_no_transition(file: Path, what: str, capsys: pytest.CaptureFixture[str]) -> None:
    changes, says = NO_DEMONSTRATIONS[what]
    _write(file, **changes)
    output = file.parent / "out"
    assert main([*learn_reward(file), "--scale", "smoke", "--output", str(output)]) == 2
    error = _one_line(capsys)
    assert f"{file}: {says}" in error
    assert "name the file demonstrations.parquet that collect-demonstrations wrote" in error
    assert not output.exists()


def test_one_row_is_enough(file: Path) -> None:
    rows = pd.DataFrame([ROW] * 3)
    storage.write_parquet(file, rows.assign(episode=[0.0, np.nan, 1.0]))
    with pytest.raises(UserError, match="column episode holds 'nan'"):
        check_demonstrations(file)


def test_what_stages_write_is_taken(file: Path) -> None:
    for fine in ({}, {"target": 49.0}, {"cs_reward": ""}, {"success": "unknown"}, {"episode": 3}):
        _write(file, **fine)
        check_demonstrations(file)
    _write(file, success="unknown")
    with pytest.raises(UserError, match="column success holds 'unknown', not true or false"):
        check_demonstrations(file, success=True)
    for fine in (True, 0, 1.0):
        _write(file, success=fine)
        check_demonstrations(file, success=True)
