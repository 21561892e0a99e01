"""States of discriminators from made-up diagnostics with known answers."""

from pathlib import Path

import pandas as pd
import pytest

from mtcsirl.errors import UserError
from mtcsirl.files import storage
from mtcsirl.results.diagnosis import (
    OF_DISCRIMINATOR,
    OF_GENERATOR,
    diagnose,
    diagnoses_markdown,
    read_diagnoses,
    state,
)
from mtcsirl.settings import Settings
from mtcsirl.study.design import design

STEPS = range(500, 20_001, 500)


def _rows(late: float, discriminators: tuple[str, ...] = ("f",)) -> pd.DataFrame:
    """Every measure is 0.6 in the first three quarters and ``late`` in the last."""
    named = [("", OF_GENERATOR), *((name, OF_DISCRIMINATOR) for name in discriminators)]
    rows = [
        {"task": "reach", "target": 1, "step": step, "discriminator": name, "metric": metric,
         "value": late if step > 15_000 else 0.6}
        for step in STEPS for name, metrics in named for metric in metrics
    ]  # fmt: skip
    return pd.DataFrame(rows)


def _gate(passed: bool) -> dict[str, object]:
    return {"task": "reach", "target": 1, "metric": 0.7, "success": 1.0, "passed": passed}


def _write_gate(folder: Path, members: list[dict[str, object]]) -> None:
    storage.write_json(folder / "gate.json", {"passed": False, "success": 0.5, "metric": 0.7, "members": members})


@pytest.mark.parametrize(
    ("accuracy", "passed", "expected"),
    [
        (float("nan"), True, "no number"), (float("nan"), False, "no number"),
        (1.0, False, "saturated"), (0.99, True, "saturated"), (0.98, True, "at work"), (0.56, False, "at work"),
        (0.55, True, "matched"), (0.5, False, "asleep"), (0.3, False, "asleep"),
    ],
)  # fmt: skip
def test_states(accuracy: float, passed: bool, expected: str) -> None:
    assert state(accuracy, passed) == expected


def test_the_last_quarter_decides_per_discriminator() -> None:
    rows = diagnose(_rows(0.8, ("f", "task")), [_gate(True)])
    assert list(rows["discriminator"]) == ["f", "task"]
    assert rows[list(OF_DISCRIMINATOR + OF_GENERATOR)].to_numpy() == pytest.approx(0.8)
    assert (rows["state"] == "at work").all()


def test_one_side_right_and_the_other_wrong_is_no_better_than_chance() -> None:
    rows = _rows(0.0)
    rows.loc[rows["metric"] == "accuracy_expert", "value"] = 1.0
    (found,) = diagnose(rows, [_gate(False)]).to_dict("records")
    assert found["state"] == "asleep"


@pytest.mark.parametrize("metric", ["accuracy_expert", "f_generator_mean"])
def test_one_iteration_without_a_number_is_no_state(metric) -> None:
    rows = _rows(0.8)
    assert diagnose(rows, [_gate(True)])["state"].tolist() == ["at work"]
    rows.loc[(rows["metric"] == metric) & (rows["step"] == 18_000), "value"] = float("nan")
    assert diagnose(rows, [_gate(True)])["state"].tolist() == ["no number"]


def test_what_lacks_a_generator_is_one_line(tmp_path) -> None:
    run = next(run for run in design(Settings()).irl_runs if run.source == "reach-wall")
    rows = _rows(1.0).assign(task=run.members[0][0])
    _write_gate(tmp_path / run.folder, [_gate(True) | {"task": run.members[0][0]}])
    storage.write_csv(tmp_path / run.folder / "diagnostics.csv", rows)
    read_diagnoses([run], tmp_path)
    for broken in (rows.assign(task="push"), rows[rows["metric"] != "temperature"]):
        storage.write_csv(tmp_path / run.folder / "diagnostics.csv", broken)
        with pytest.raises(UserError, match=r"gate\.json or diagnostics\.csv lacks") as error:
            read_diagnoses([run], tmp_path)
        assert "\n" not in str(error.value)
    storage.write_csv(tmp_path / run.folder / "diagnostics.csv", rows)
    storage.write_json(tmp_path / run.folder / "gate.json", _gate(True))
    with pytest.raises(UserError, match="lacks 'members'"):
        read_diagnoses([run], tmp_path)


@pytest.mark.parametrize("said", [{"passed": "false"}, {"success": "1.0"}, {"metric": [0.7]}])
def test_what_no_gate_says_is_refused(tmp_path, said) -> None:
    run = next(run for run in design(Settings()).irl_runs if run.source == "reach-wall")
    storage.write_csv(tmp_path / run.folder / "diagnostics.csv", _rows(1.0).assign(task=run.members[0][0]))
    _write_gate(tmp_path / run.folder, [_gate(True) | {"task": run.members[0][0]} | said])
    with pytest.raises(UserError, match="not the verdict of a gate"):
        read_diagnoses([run], tmp_path)


def test_the_runs_of_a_study_are_read_and_counted(tmp_path) -> None:
    run = next(run for run in design(Settings()).irl_runs if run.source == "reach-wall")
    with pytest.raises(UserError, match=r"diagnostics\.csv"):
        read_diagnoses([run], tmp_path)
    storage.write_csv(tmp_path / run.folder / "diagnostics.csv", _rows(1.0).assign(task=run.members[0][0]))
    _write_gate(tmp_path / run.folder, [_gate(False) | {"task": run.members[0][0]}])
    text = diagnoses_markdown(read_diagnoses([run], tmp_path), ["a note"])
    assert f"- {run.experiment} mt_csirl {run.cs_reward}, f: 1 saturated" in text
    assert "0.70, success 1.0 *" in text
    assert "a note" in text
