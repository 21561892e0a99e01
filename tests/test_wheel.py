"""A wheel built from the checkout works without it: verbs, data files, configurations of all scales."""

import os
import shutil
import subprocess
import sys
import zipfile
from collections.abc import Callable
from pathlib import Path

import pytest

from mtcsirl.settings.loading import CONFIG, SHIPPED

BUILT_FROM = ("src", "config", "pyproject.toml", "README.md", "LICENSE")
Run = Callable[..., subprocess.CompletedProcess[str]]
pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def wheel(checkout: Path, tmp_path_factory: pytest.TempPathFactory) -> zipfile.ZipFile:
    """Built without the network from a copy, so that the checkout gets no build folder."""
    source = tmp_path_factory.mktemp("source")
    ignore = shutil.ignore_patterns("__pycache__", "*.egg-info")
    for name in BUILT_FROM:
        here = checkout / name
        if here.is_dir():
            shutil.copytree(here, source / name, symlinks=True, ignore=ignore)
        else:
            shutil.copy(here, source / name)
    built = tmp_path_factory.mktemp("wheel")
    command = [sys.executable, "-m", "pip", "wheel", "--quiet", "--no-deps", "--no-build-isolation", "--no-index"]
    subprocess.run([*command, "--wheel-dir", str(built), str(source)], check=True, capture_output=True)
    return zipfile.ZipFile(next(built.glob("mtcsirl-*.whl")))


@pytest.fixture(scope="module")
def run(wheel: zipfile.ZipFile, tmp_path_factory: pytest.TempPathFactory) -> Run:
    """Run Python in an empty folder, with the unpacked wheel before everything else."""
    installed, elsewhere = tmp_path_factory.mktemp("installed"), tmp_path_factory.mktemp("elsewhere")
    wheel.extractall(installed)

    def python(*arguments: str) -> subprocess.CompletedProcess[str]:
        environment = os.environ | {"PYTHONPATH": str(installed), "PYTHONDONTWRITEBYTECODE": "1"}
        command = [sys.executable, *arguments]
        return subprocess.run(command, cwd=elsewhere, env=environment, capture_output=True, text=True, check=False)

    where = python("-c", "import mtcsirl; print(mtcsirl.__file__)")
    assert where.stdout.strip() == str(installed / "mtcsirl/__init__.py"), where.stderr
    return python


def test_every_file_of_the_package_is_in_it(wheel: zipfile.ZipFile, checkout: Path) -> None:
    package = checkout / "src" / "mtcsirl"
    own = [file for file in package.rglob("*") if file.is_file() and "__pycache__" not in file.parts]
    expected = {f"mtcsirl/{file.relative_to(package)}" for file in own}
    expected |= {f"mtcsirl/config/{file.name}" for file in (checkout / "config").glob("*.yaml")}
    assert expected - set(wheel.namelist()) == set()
    assert not any(name.startswith(("tests", "benchmarks", "examples")) for name in wheel.namelist())


def test_the_package_brings_the_checkouts_configurations() -> None:
    assert SHIPPED.parts[-1] == "config"
    assert SHIPPED.samefile(CONFIG)


@pytest.mark.parametrize("scale", ["smoke", "desk", "paper"])
def test_plan(run: Run, scale: str) -> None:
    done = run("-m", "mtcsirl.cli", "plan", "--scale", scale)
    assert done.returncode == 0, done.stderr
    assert "learn_reward" in done.stdout


def test_tables_and_claims_of_nothing(run: Run) -> None:
    table = run("-m", "mtcsirl.cli", "table", "5", "--partial", "--output", "out")
    assert table.returncode == 0, table.stderr
    claims = run("-m", "mtcsirl.cli", "claims", "--partial", "--output", "out")
    assert claims.returncode == 0, claims.stderr


def test_an_agent_trains_and_the_environments_are_there(run: Run) -> None:
    small = ("steps=40", "sac.hidden_sizes=[8]", "evaluation.episodes=1", "evaluation.episode_steps=20")
    settings = [part for one in small for part in ("--set", one)]
    key = ("--task", "reach", "--seed", "0", "--output", "agent")
    done = run("-m", "mtcsirl.cli", "train-sac", *key, *settings)
    assert done.returncode == 0, done.stderr
    name = "mtcsirl.exports.environments:mtcsirl/reach-wall-v0"
    made = run("-c", f"import gymnasium; print(gymnasium.make({name!r}, target=3).reset()[0].shape)")
    assert made.stdout == "(39,)\n", made.stderr


def test_what_is_not_there_is_one_line(run: Run) -> None:
    done = run("-m", "mtcsirl.cli", "plan", "--config", "config/paper.yaml")
    assert done.returncode == 2
    assert len(done.stderr.splitlines()) == 1
