"""What a user wrote is answered with where it stands, what is wrong and how to mend it, never with making it again."""

import subprocess
import sys
from pathlib import Path

import pytest

from mtcsirl import cli
from mtcsirl.settings.sources import holder

KEY = ["--task", "reach", "--seed", "0", "--output", "x"]
LEARN = ["--method", "mt_csirl", "--cs-reward", "velocity", "--seed", "0", "--output", "x"]
FILES = {
    "mine.yaml": b"sac: {minibach: 3}\n",
    "fine.yaml": b"sac: {minibatch: 3}\n",
    "truth.yaml": b"seeds: [0, yes]\n",
    "latin.yaml": b"# all of it\n# f\xfcr mich\nseeds: [0]\n",
    "README.md": b"# mine\n",
}

WRONG = [
    (["plan", "--config", "mine.yaml"], "mine.yaml: sac.minibach = 3: unknown key, did you mean minibatch?"),
    (["plan", "--config", "mine.yaml", "--config", "fine.yaml"], "mine.yaml: sac.minibach"),
    (["plan", "--config", "fine.yaml", "--set", "sac.minibatch=-1"], "--set: sac.minibatch = -1: must be"),
    (["plan", "--config", "truth.yaml"], "truth.yaml: seeds.1 = True: must be a int, not a truth value"),
    (["plan", "--settings", "mine.yaml"], "mine.yaml: sac.minibach"),
    (["plan", "--settings", '{"seeds": [-1]}'], "--settings: seeds.0 = -1: must be"),
    (["train-sac", *KEY, "--set", "sac.minibach=3"], "--set: sac.minibach = 3: unknown key"),
    (["train-sac", *KEY, "--set", "cs_weight=3"], "--set: cs_weight = 3.0: train-sac does not read this key"),
    (["train-sac", *KEY, "--config", "mine.yaml"], "mine.yaml: sac.minibach"),
    (["plan", "--config", "latin.yaml"], "latin.yaml: not UTF-8 (line 2); save it in that encoding"),
    (["plan", "--config", "nope.yaml"], "nope.yaml: no such file; check its name"),
    (["plan", "--config", "."], ".: is a folder; name a file"),
    (["plan", "--config", "/dev/null"], "/dev/null: is a device or a pipe; name a file"),
    (["plan", "--rates", "nope"], "nope: no such file; name a file that mtcsirl calibrate --output FILE wrote"),
    (["plan", "--rates", "fine.yaml"], "name a file that mtcsirl calibrate --output FILE wrote"),
    (["plan", "--rates", "latin.yaml"], "name a file that mtcsirl calibrate --output FILE wrote"),
    (["learn-reward", *LEARN, "--demonstrations", "README.md"], "name the file demonstrations.parquet that"),
    (["learn-reward", *LEARN, "--demonstrations", "."], ".: is a folder; name a file"),
    (["learn-reward", *LEARN, "--demonstrations", "nope"], "nope: no such file; run the stage that makes it first"),
    (
        ["export-demonstrations", "--output", "x", "--demonstrations", "README.md"],
        "name the file demonstrations.parquet",
    ),
]


@pytest.mark.parametrize(("words", "says"), WRONG, ids=lambda value: " ".join(value)[-60:] if value else "")
def test_a_mistake_is_named_where_it_was_written(
    words: list[str], says: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    for name, content in FILES.items():
        (tmp_path / name).write_bytes(content)
    assert cli.main(words) == 2
    error = capsys.readouterr().err
    assert error.count("\n") == 1
    assert says in error
    assert "delete it" not in error
    assert {path.name for path in tmp_path.iterdir()} == set(FILES)


def test_the_last_that_holds_a_key_is_its_holder() -> None:
    sources = [("one", {"a": {"b": [1, 2]}}), ("two", {"a": {"c": 1}, 3: 4})]
    assert holder("a.b.1", sources) == "one"
    assert holder("a", sources) == holder("3", sources) == "two"
    assert holder("a.b.2", sources) == holder("", sources) == holder("a.c.d", sources) == "configuration"


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (["--configfile", "fine.yaml", "mine.yaml"], "mine.yaml: sac.minibach = 3: unknown key"),
        (["--configfile", "fine.yaml", "--config", "sac={minibatch: -1}"], "--config: sac.minibatch = '-1': must be"),
        (["--config", "results=fine.yaml"], "--config: results = 'fine.yaml': it is a file; name a folder"),
        (["--cores", "0"], "--cores 0: no job could ever start; give at least 1"),
    ],
    ids=" ".join,
)
def test_snakemake_says_the_same(words: list[str], says: str, checkout: Path, tmp_path: Path) -> None:
    for name, content in FILES.items():
        (tmp_path / name).write_bytes(content)
    command = [sys.executable, "-m", "snakemake", "--snakefile", str(checkout / "Snakefile"), "table_5", "--cores", "1"]
    done = subprocess.run([*command, *words], cwd=tmp_path, capture_output=True, text=True, timeout=60, check=False)
    assert done.returncode != 0
    assert says in done.stderr.splitlines()[-1]
    assert "Traceback" not in done.stderr
