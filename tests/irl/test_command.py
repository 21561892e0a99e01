"""`mtcsirl learn-reward` on files of one's own: settings are those of the tasks demonstrated, not of all tasks."""

import pytest

from mtcsirl.cli import main
from mtcsirl.files.identity import read_record
from mtcsirl.files.storage import read_json
from tests.irl.conftest import MEMBERS
from tests.words import learn_reward


def test_a_run_has_the_settings_of_its_own_tasks(demonstrations, tmp_path):
    overlay = tmp_path / "overlay.yaml"
    overlay.write_text("irl: {warm_up_iterations: {push-back: 2}}\nexploration: {scripted_steps: {push-back: 50}}\n")
    assert "push-back" not in [task for task, _ in MEMBERS]
    output = tmp_path / "run"
    words = [*learn_reward(*demonstrations, seed=100), "--scale", "smoke", "--config", str(overlay)]
    assert main([*words, "--output", str(output)]) == 0
    settings = read_json(output / "settings.json")
    assert settings["irl"]["warm_up_iterations"] == 1
    assert "push-back" not in settings["scripted_steps"]


@pytest.mark.parametrize(("asked", "key"), [("multi_target", "multi_target"), (None, "single_target")])
def test_several_targets_may_be_one_where_the_study_says_so(demonstrations, tmp_path, asked, key):
    words = [*learn_reward(demonstrations[0], seed=100), "--scale", "smoke", "--output", str(tmp_path / "run")]
    assert main([*words, *(["--experiment", asked] if asked else [])]) == 0
    assert read_record(tmp_path / "run").identity.key["experiment"] == key


@pytest.mark.slow
def test_workers_change_no_byte(demonstrations, tmp_path):
    words = [*learn_reward(*demonstrations, seed=7), "--scale", "smoke", "--set", "irl.iterations=1"]
    for workers in ("0", "2"):
        assert main([*words, "--workers", workers, "--output", str(tmp_path / workers)]) == 0
    left = sorted(file.name for file in (tmp_path / "0").iterdir() if file.name != "provenance.json")
    assert "reward.safetensors" in left
    assert "identity.json" in left
    for name in left:
        if (tmp_path / "0" / name).is_file():
            assert (tmp_path / "0" / name).read_bytes() == (tmp_path / "2" / name).read_bytes(), name
