"""Nothing that is said twice on a command line is dropped without a word."""

import json
from pathlib import Path

import pytest

from mtcsirl import cli
from mtcsirl.settings.loading import load
from mtcsirl.settings.runs import baseline_run

KEY = ["train-sac", "--task", "reach", "--seed", "0", "--output", "x"]
RUN = baseline_run(load(), "reach").model_dump_json()
WRONG = [
    (["settings", "check", "--settings", "f.json", "--config", "/no.yaml"], "--settings and --config /no.yaml: "),
    (["plan", "--scale", "smoke", "--settings", "{}"], "--settings and --scale smoke: --settings takes the place of"),
    (
        ["status", "--scale", "desk", "--settings", "{}", "--config", "a"],
        "--settings and --scale desk and --config a: ",
    ),
    ([*KEY, "--settings", RUN, "--scale", "paper"], "--settings and --scale paper: "),
    ([*KEY, "--settings", RUN, "--config", "f.yaml"], "--settings and --config f.yaml: "),
    ([*KEY, "--seed", "1"], "argument --seed: given twice; give it once"),
    ([*KEY, "--target", "0", "--target", "3"], "argument --target: given twice; give it once"),
    (["plan", "--scale", "smoke", "--scale", "paper"], "argument --scale: given twice; give it once"),
    (["plan", "--settings", "{}", "--settings", "f.json"], "argument --settings: given twice; give it once"),
    (
        ["train-together", "--stages", "transfer", "--stages", "train_sac"],
        "--stages: given twice; give it once, with all",
    ),
    ([*KEY, "--set", "steps=5", "--set", "steps=6"], "--set steps: given twice; keep one"),
    ([*KEY, "--device", "cuda", "--set", "sac.device=cpu"], "--set sac.device: given twice; keep one"),
]


@pytest.mark.parametrize(("words", "says"), WRONG, ids=[says for _, says in WRONG])
def test_what_is_said_twice_is_refused(
    words: list[str], says: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "f.json").write_text("{}")
    assert cli.main(words) == 2
    error = capsys.readouterr().err
    assert error.count("\n") == 1
    assert says in error
    assert [path.name for path in tmp_path.iterdir()] == ["f.json"]


def test_what_may_be_repeated_is_all_read(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "one.yaml").write_text("seeds: [1]\nsac: {minibatch: 3}\n")
    (tmp_path / "two.yaml").write_text("seeds: [2]\n")
    overlays = ["--config", "one.yaml", "--config", "two.yaml", "--scale", "smoke"]
    assert cli.main(["settings", "json", *overlays, "--set", "irl_seeds=[3]", "--set", "sac.critics=4"]) == 0
    read = json.loads(capsys.readouterr().out)
    assert (read["seeds"], read["irl_seeds"], read["scale"]) == ([2], [3], "smoke")
    assert (read["sac"]["minibatch"], read["sac"]["critics"]) == (3, 4)
    assert cli.main(["settings", "check", "--settings", "one.yaml", "--set", "seeds=[4]"]) == 0


def test_one_parser_reads_several_command_lines() -> None:
    parser = cli.parser()
    assert [parser.parse_args(["plan", "--scale", scale]).scale for scale in ("smoke", "paper")] == ["smoke", "paper"]
