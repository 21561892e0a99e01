"""A wheel built from the checkout works without it: verbs, data files, configurations of all scales, videos."""

import os
import shutil
import subprocess
import sys
import sysconfig
import venv
import zipfile
from collections.abc import Callable
from pathlib import Path

import pytest

from mtcsirl.settings.loading import CONFIG, SHIPPED
from tests.conftest import needs_rendering

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
def environment(wheel: zipfile.ZipFile, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The programs of a fresh environment with the wheel; its dependencies are those of the tests, by their path."""
    folder = tmp_path_factory.mktemp("fresh")
    venv.create(folder, with_pip=True)
    command = [folder / "bin" / "python", "-m", "pip", "install", "--quiet", "--no-index", "--no-deps", wheel.filename]
    subprocess.run(command, check=True, capture_output=True)
    (site,) = folder.glob("lib/python*/site-packages")
    (site / "dependencies.pth").write_text(sysconfig.get_path("purelib"), encoding="utf-8")
    return folder / "bin"


@pytest.fixture(scope="module")
def run(environment: Path, tmp_path_factory: pytest.TempPathFactory) -> Run:
    """Run a program of the fresh environment in a folder of its own, empty at first."""
    elsewhere = tmp_path_factory.mktemp("elsewhere")
    inherited = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}

    def program(name: str, *arguments: str) -> subprocess.CompletedProcess[str]:
        command = [str(environment / name), *arguments]
        return subprocess.run(command, cwd=elsewhere, env=inherited, capture_output=True, text=True, check=False)

    where = program("python", "-c", "import mtcsirl; print(mtcsirl.__file__)")
    assert Path(where.stdout.strip()).is_relative_to(environment.parent), where.stderr
    return program


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
    done = run("mtcsirl", "plan", "--scale", scale)
    assert done.returncode == 0, done.stderr
    assert "learn_reward" in done.stdout


def test_tables_and_claims_of_nothing(run: Run) -> None:
    table = run("mtcsirl", "table", "5", "--partial", "--output", "out")
    assert table.returncode == 0, table.stderr
    claims = run("mtcsirl", "claims", "--partial", "--output", "out")
    assert claims.returncode == 0, claims.stderr


def test_an_agent_trains_and_the_environments_are_there(run: Run) -> None:
    small = ("steps=40", "sac.hidden_sizes=[8]", "evaluation.episodes=1", "evaluation.episode_steps=20")
    settings = [part for one in small for part in ("--set", one)]
    key = ("--task", "reach", "--seed", "0", "--output", "agent")
    done = run("mtcsirl", "train-sac", *key, *settings)
    assert done.returncode == 0, done.stderr
    name = "mtcsirl.exports.environments:mtcsirl/reach-wall-v0"
    made = run("python", "-c", f"import gymnasium; print(gymnasium.make({name!r}, target=3).reset()[0].shape)")
    assert made.stdout == "(39,)\n", made.stderr


@needs_rendering
def test_a_video_of_that_agent(run: Run) -> None:
    done = run("mtcsirl", "video", "agent", "--output", "agent.gif", "--steps", "8", "--size", "64")
    assert done.returncode == 0, done.stderr
    shown = run("python", "-c", "import PIL.Image; print(PIL.Image.open('agent.gif').n_frames)")
    assert int(shown.stdout) > 1, shown.stderr


def test_a_wheel_that_lacks_its_data_is_seen(environment: Path, run: Run) -> None:
    """What the tests above rest on: none of them falls back on the checkout."""
    (rates,) = environment.parent.glob("lib/python*/site-packages/mtcsirl/study/calibration.json")
    away = rates.with_suffix(".away")
    rates.rename(away)
    try:
        assert run("mtcsirl", "plan").returncode != 0
    finally:
        away.rename(rates)


def test_what_is_not_there_is_one_line(run: Run) -> None:
    done = run("mtcsirl", "plan", "--config", "config/paper.yaml")
    assert done.returncode == 2
    assert len(done.stderr.splitlines()) == 1
