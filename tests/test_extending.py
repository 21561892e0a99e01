"""docs/extending.md does what it says: its blocks run as printed, and the DAG makes a table and a figure of them."""

import os
import re
import subprocess
import sys
from pathlib import Path

import pandas as pd
import pytest

from mtcsirl.errors import UserError
from mtcsirl.extensions import load_extensions
from mtcsirl.names import TASKS
from mtcsirl.study.keys import read_folder
from mtcsirl.study.runs import Demonstrations

NAMED = re.compile(r"^`(\w+\.(?:py|yaml))`:.*?^```(?:python|yaml)\n(.*?)^```", re.MULTILINE | re.DOTALL)

SMALLER = """
seeds: [0]
single_target: {tasks: [reach-wall]}
multi_task: {train_tasks: [coffee-button, drawer-close], train_targets: [0], unseen_tasks: [reach-wall]}
"""


def _blocks(checkout: Path) -> dict[str, str]:
    return dict(NAMED.findall((checkout / "docs/extending.md").read_text(encoding="utf-8")))


@pytest.fixture
def folder(checkout: Path, tmp_path: Path) -> Path:
    """A working directory with the files of the page."""
    for name, text in _blocks(checkout).items():
        (tmp_path / name).write_text(text, encoding="utf-8")
    return tmp_path


def _run(folder: Path, *command: str, **variables: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-m", *command], cwd=folder, env=os.environ | variables, capture_output=True, text=True
    )


def test_each_is_under_forty_lines(checkout: Path) -> None:
    blocks = _blocks(checkout)
    assert set(blocks) == {"energy.py", "gail.py", "mine.yaml"}
    assert all(len(text.splitlines()) < 40 for text in blocks.values())


def test_the_configuration_is_valid_and_plans_their_runs(folder: Path) -> None:
    done = _run(folder, "mtcsirl.cli", "plan", "--config", "mine.yaml")
    assert done.returncode == 0, done.stderr
    assert "learn_reward" in done.stdout
    without = _run(folder, "mtcsirl.cli", "settings", "check", "--config", "mine.yaml", "--set", "extensions=[]")
    assert without.returncode == 2
    assert "unknown common-sense reward 'energy'" in without.stderr


def test_the_command_line_knows_them_by_the_environment_variable(folder: Path) -> None:
    arguments = ("learn-reward", "--method", "mt_gail", "--cs-reward", "energy", "--seed", "0", "--output", "out")
    arguments += ("--demonstrations", "nothing.parquet")
    known = _run(folder, "mtcsirl.cli", *arguments, MTCSIRL_EXTENSIONS="energy.py:gail.py")
    assert "nothing.parquet" in known.stderr, "it got as far as the missing demonstrations"
    assert "unknown method 'mt_gail'" in _run(folder, "mtcsirl.cli", *arguments).stderr


def test_what_is_wrong_with_an_extension_is_one_line(tmp_path: Path) -> None:
    with pytest.raises(UserError, match=r"extensions: .*gone\.py: no such file"):
        load_extensions([tmp_path / "gone.py"])
    (tmp_path / "broken.py").write_text("1 / 0\n")
    with pytest.raises(UserError, match=r"broken\.py: ZeroDivisionError: division by zero"):
        load_extensions([tmp_path / "broken.py"])


def test_the_demonstrations_of_the_command_are_where_a_study_leaves_them(checkout: Path) -> None:
    page = (checkout / "docs/extending.md").read_text(encoding="utf-8")
    (path,) = re.findall(r"--demonstrations (\S+)", page)
    folder, name = path.removeprefix("results/").rsplit("/", 1)
    key = read_folder(Demonstrations.PATTERN, folder)
    assert key is not None, f"{path} is none of {Demonstrations.PATTERN}"
    assert (key["cs_reward"], key["task"] in TASKS, name) == ("velocity", True, "demonstrations.parquet")


@pytest.mark.dag
def test_tables_and_figures_come_out_without_editing_a_rule(folder: Path, checkout: Path) -> None:
    (folder / "smaller.yaml").write_text(SMALLER)
    overlays = (str(checkout / "config/smoke.yaml"), "mine.yaml", "smaller.yaml")
    snakefile = ("snakemake", "--snakefile", str(checkout / "Snakefile"), "--directory", str(folder))
    done = _run(folder, *snakefile, "--cores", "2", "table_2", "figure_3", "--configfile", *overlays)
    assert done.returncode == 0, done.stderr[-4000:]
    table = pd.read_csv(folder / "results/mine/tables/table_2.csv", dtype=str)
    assert "MT-GAIL" in table.to_string()
    assert "energy" in table.to_string()
    assert (folder / "paper_figs/mine/figure_3.pdf").stat().st_size > 10_000
    assert list(folder.glob("results/mine/transfer/multi_task/mt_gail/energy/all/reach-wall-t0/s0/gate.json"))
