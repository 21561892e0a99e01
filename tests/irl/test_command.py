"""`mtcsirl learn-reward` on files of one's own: settings are those of the tasks demonstrated, not of all tasks."""

from mtcsirl.cli import main
from mtcsirl.files.storage import read_json
from tests.irl.conftest import MEMBERS


def test_a_run_has_the_settings_of_its_own_tasks(demonstrations, tmp_path):
    overlay = tmp_path / "overlay.yaml"
    overlay.write_text("irl: {warm_up_iterations: {push-back: 2}}\nexploration: {scripted_steps: {push-back: 50}}\n")
    assert "push-back" not in [task for task, _ in MEMBERS]
    files = [str(file) for file in demonstrations]
    arguments = ["--method", "mt_csirl", "--cs-reward", "velocity", "--seed", "100", "--scale", "smoke"]
    output = tmp_path / "run"
    given = [*arguments, "--config", str(overlay), "--demonstrations", *files, "--output", str(output)]
    assert main(["learn-reward", *given]) == 0
    settings = read_json(output / "settings.json")
    assert settings["irl"]["warm_up_iterations"] == 1
    assert "push-back" not in settings["scripted_steps"]


def test_workers_change_no_byte(demonstrations, tmp_path):
    files = [str(file) for file in demonstrations]
    given = ["--method", "mt_csirl", "--cs-reward", "velocity", "--seed", "7", "--scale", "smoke"]
    given += ["--set", "irl.iterations=1", "--demonstrations", *files]
    for workers in ("0", "2"):
        assert main(["learn-reward", *given, "--workers", workers, "--output", str(tmp_path / workers)]) == 0
    left = sorted(file.name for file in (tmp_path / "0").iterdir() if file.name != "provenance.json")
    assert "reward.safetensors" in left
    assert "identity.json" in left
    for name in left:
        if (tmp_path / "0" / name).is_file():
            assert (tmp_path / "0" / name).read_bytes() == (tmp_path / "2" / name).read_bytes(), name
