"""Odd arguments, places and inputs: each ends in one line that names it, before any work, and leaves nothing."""

import json
import resource
import shlex
import subprocess
import sys
from pathlib import Path

import pandas as pd
import pytest
from snakemake.cli import parse_config

from mtcsirl import cli
from mtcsirl.commands.remedy import snakemake_command
from mtcsirl.episodes.demonstrations import COLUMNS
from mtcsirl.files import storage
from mtcsirl.settings.loading import CONFIG, configured, load, merge, read_yaml
from mtcsirl.study.outputs import OUTPUTS
from tests.words import learn_reward

KEY = ["--task", "reach", "--seed", "0"]
VELOCITY = ["--cs-reward", "velocity"]
EVALUATE = ["evaluate", *KEY, "--policy", ".", "--output", "x"]


def fails(capsys: pytest.CaptureFixture[str], *arguments: str) -> str:
    """The one line that a wrong call prints."""
    assert cli.main(arguments) == 2
    error = capsys.readouterr().err
    assert error.count("\n") == 1, error
    assert error.startswith("mtcsirl: ")
    return error


@pytest.fixture
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An empty working folder."""
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (["plan", "--cores", "0"], "--cores: '0': must be a whole number from 1"),
        (["status", "--cores", "-1"], "--cores: '-1': must be a whole number from 1"),
        (["plan", "--cores", "two"], "--cores: 'two': must be a whole number from 1"),
        (["plan", "--cores", "9" * 5000], "must be a whole number from 1"),
        (["train-together", "--most", "0"], "--most: '0': must be a whole number from 1"),
        (["validate", "--processes", "0"], "--processes: '0': must be a whole number from 1"),
        (["video", "x", "--output", "x.gif", "--size", "0"], "--size: '0': must be a whole number from 1"),
        (["video", "x", "--output", "x.gif", "--size", "100000"], "--size: '100000': must be 64 to 1024"),
        (["video", "x", "--output", "x.gif", "--steps", "0"], "--steps: '0': must be a whole number from 1"),
        (["video", "x", "--output", "x.gif", "--target-seed", "4294967296"], "from 0 to 4294967295"),
        (["video", "x", "--output", "x.avi"], "x.avi: videos end in .gif or .mp4"),
        (["train-sac", "--task", "reach", "--seed", "1" * 23, "--output", "x"], "from 0 to 9007199254740991"),
        (["train-sac", *KEY, "--output", ""], "--output: must not be empty"),
        (["train-sac", *KEY, "--output", "x", "--settings", ""], "--settings: must not be empty"),
        (["plan", "--settings", " "], "--settings: must not be empty"),
        (["plan", "--config", ""], "--config: must not be empty"),
        (["plan", "--rates", ""], "--rates: must not be empty"),
        (["table", "2", "--output", ""], "--output: must not be empty"),
        (["evaluate", *KEY, "--policy", "", "--output", "x"], "--policy: must not be empty"),
        ([*EVALUATE, "--cs-reward", "banana"], "unknown common-sense reward 'banana'; allowed: velocity, "),
        ([*EVALUATE, "--set", "environment.observation=raw"], "environment.observation = 'raw': evaluate does"),
        ([*EVALUATE, "--set", "environment={observation: raw}"], "environment.observation = 'raw': evaluate does"),
        ([*EVALUATE, "--set", "sac.minibatch=3"], "sac.minibatch = 3: evaluate does not read this key, only"),
        ([*EVALUATE, "--set", "evaluation.episodes=2", "--set", "steps=7"], "steps = 7: evaluate does not read"),
        ([*EVALUATE, "--set", "evaluation.episode=2"], "evaluation.episode = 2: unknown key, did you mean episodes?"),
        (["plan", "--settings", '{"seeds": [0], "seeds": [1]}'], "--settings: the key 'seeds' stands twice"),
        (
            ["train-sac", *KEY, "--output", "x", "--set", "cs_weight=3"],
            "cs_weight = 3.0: train-sac does not read this key",
        ),
        (
            [
                "transfer",
                *KEY,
                "--cs-reward",
                "velocity",
                "--reward",
                ".",
                "--output",
                "x",
                "--set",
                "progress.select_every=9",
            ],
            "progress.select_every = 9: transfer does not read this key",
        ),
    ],
    ids=lambda value: " ".join(value)[:60] if isinstance(value, list) else "",
)
def test_an_argument_that_cannot_be_meant_is_named(
    arguments: list[str], says: str, capsys: pytest.CaptureFixture[str], here: Path
) -> None:
    assert says in fails(capsys, *arguments)
    assert not list(here.iterdir()), "nothing is written"


WRITERS = [
    ["train-sac", *KEY],
    ["calibrate"],
    ["validate"],
    ["table", "5"],
    ["figure", "1"],
    ["claims"],
    ["evaluate", *KEY, "--policy", "."],
    ["export-policy", "--policy", "."],
    ["export-demonstrations", "--demonstrations", "x.parquet"],
    ["draw-diagnostics", "--run", "."],
]


@pytest.mark.parametrize("verb", WRITERS, ids=lambda verb: verb[0])
def test_a_place_that_cannot_be_written_is_named_before_any_work(
    verb: list[str], capsys: pytest.CaptureFixture[str], here: Path
) -> None:
    (here / "file").write_text("mine")
    assert "file" in fails(capsys, *verb, "--output", "file/inside")
    assert (here / "file").read_text() == "mine"
    assert [path.name for path in here.iterdir()] == ["file"]


def test_a_folder_is_no_file_and_a_device_no_place(capsys: pytest.CaptureFixture[str], here: Path) -> None:
    (here / "folder").mkdir()
    assert "folder: is a folder; name a file" in fails(capsys, "calibrate", "--output", "folder")
    assert "/dev/full: is neither a file nor a folder" in fails(capsys, "calibrate", "--output", "/dev/full")
    (here / "mine.json").write_text('{"a": 1}')
    assert "mine.json: is there and holds no rates" in fails(capsys, "calibrate", "--output", "mine.json")
    assert (here / "mine.json").read_text() == '{"a": 1}'


def test_a_full_disk_is_noticed_before_calibrate_measures(here: Path) -> None:
    """A process that may write no byte to any file stands for the disk."""
    command = [sys.executable, "-m", "mtcsirl.cli", "calibrate", "--output", "rates.json"]
    done = subprocess.run(
        command,
        capture_output=True,
        text=True,
        timeout=20,
        check=False,
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (0, 0)),
    )
    assert done.returncode == 2
    assert done.stderr.count("\n") == 1
    assert "cannot be written (" in done.stderr
    assert not list(here.iterdir())


@pytest.mark.parametrize("stage", OUTPUTS)
def test_evaluate_leaves_the_folder_of_a_run_alone(stage: str, capsys: pytest.CaptureFixture[str], here: Path) -> None:
    run = here / "run"
    for name in OUTPUTS[stage]:
        storage.write_text(run / name, name)
    assert "holds another run" in fails(capsys, "evaluate", *KEY, "--policy", ".", "--output", "run")
    assert all((run / name).read_text() == name for name in OUTPUTS[stage])


def test_a_training_does_not_start_in_the_folder_of_another_stage(
    capsys: pytest.CaptureFixture[str], here: Path
) -> None:
    storage.write_text(here / "irl/reward.safetensors", "x")
    storage.write_text(here / "expert/policy.safetensors", "x")
    assert "irl: holds another run (reward.safetensors)" in fails(capsys, "train-sac", *KEY, "--output", "irl")
    collect = ["collect-demonstrations", *KEY, "--cs-reward", "velocity", "--expert", "expert", "--output", "expert"]
    assert "expert: holds another run (policy.safetensors)" in fails(capsys, *collect)


@pytest.mark.parametrize(
    ("members", "asked", "found"),
    [
        ([("reach", 1)], "multi_task", "single_target"),
        ([("reach", 1), ("reach", 2)], "multi_task", "multi_target"),
        ([("reach", 1), ("reach", 2)], "single_target", "multi_target"),
        ([("reach", 1), ("push", 1)], "multi_target", "multi_task"),
    ],
)
def test_an_experiment_that_the_demonstrations_are_not_is_refused(
    members: list[tuple[str, int]], asked: str, found: str, capsys: pytest.CaptureFixture[str], here: Path
) -> None:
    files = []
    for task, target in members:
        files.append(f"{task}{target}.parquet")
        rows = {name: [0.0] for name in COLUMNS} | {"task": [task], "target": [target], "cs_reward": ["velocity"]}
        storage.write_parquet(here / files[-1], pd.DataFrame(rows))
    assert f"which is {found}" in fails(capsys, *learn_reward(*files), "--output", "run", "--experiment", asked)
    assert not (here / "run").exists()


@pytest.mark.parametrize(
    "arguments",
    [
        [],
        ["--scale", "smoke"],
        ["--scale", "smoke", "--config", "my study.yaml", "--set", "sac.minibatch=64", "--set", "results=my results"],
        ["--config", "my study.yaml", "--set", "irl.temperature=automatic", "--set", "seeds=[3, 4]"],
        ["--settings", "my study.yaml"],
    ],
    ids=" ".join,
)
def test_advice_runs_as_it_is_printed(arguments: list[str], capsys: pytest.CaptureFixture[str], here: Path) -> None:
    """What Snakemake would read from the printed command is the configuration that the verb had."""
    (here / "my study.yaml").write_text("figures: it's mine\nseeds: [7]\n")
    error = fails(capsys, "table", "2", *arguments)
    command = error.partition("make it with `")[2].partition("`")[0]
    words = shlex.split(command)
    assert words[:6] == ["snakemake", "--cores", "2", "--snakefile", str(CONFIG.parent / "Snakefile"), "table_2"]
    options: dict[str, list[str]] = {}
    for word in words[6:]:
        if word.startswith("--"):
            options[word] = []
        else:
            options[list(options)[-1]].append(word)
    data = read_yaml(CONFIG / "config.yaml")
    for file in options.get("--configfile", []):
        data = merge(data, read_yaml(file))
    read = configured(merge(data, parse_config(options.get("--config", []))))
    parsed = cli.parser().parse_args(["table", "2", *arguments])
    own = configured(merge(read_yaml(CONFIG / "config.yaml"), read_yaml(parsed.settings))) if parsed.settings else None
    assert read == (own or load(parsed.config, parsed.set, parsed.scale))


def test_in_the_checkout_the_advice_is_short(monkeypatch: pytest.MonkeyPatch, checkout: Path) -> None:
    monkeypatch.chdir(checkout)
    parsed = cli.parser().parse_args(["table", "2", "--scale", "smoke"])
    command = snakemake_command(parsed, "table_2")
    assert command == "snakemake --cores 2 table_2 --configfile config/smoke.yaml"
    given = cli.parser().parse_args(["table", "2", "--settings", json.dumps({"seeds": [1]})])
    assert snakemake_command(given, "table_2") == "snakemake --cores 2 table_2 with the configuration of --settings"


@pytest.mark.parametrize("verb", ["reward-quality", "reward-preference", "diagnostics"])
def test_a_summary_of_nothing_says_so(verb: str, capsys: pytest.CaptureFixture[str], here: Path) -> None:
    assert cli.main([verb, "--partial"]) == 0
    assert list(here.rglob("*.csv"))
    assert list(here.rglob("*.md"))


def test_an_own_cs_reward_says_what_it_falls_back_to(
    capsys: pytest.CaptureFixture[str], checkout: Path, here: Path
) -> None:
    page = (checkout / "docs/extending.md").read_text()
    (here / "energy.py").write_text(page.partition("```python\n")[2].partition("```")[0])
    words = ["--set", "extensions=[energy.py]", "--set", "cs_rewards=[velocity, energy]"]
    done = subprocess.run(
        [sys.executable, "-m", "mtcsirl.cli", "settings", "check", *words], capture_output=True, text=True, check=True
    )
    assert "energy: has no expert.cs_weight; its experts take 1.0" in done.stdout
    assert "energy: has no gate of its own; its experts take gates.expert_velocity" in done.stdout
    assert "velocity:" not in done.stdout
    assert not capsys.readouterr().err
