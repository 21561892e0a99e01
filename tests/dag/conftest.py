"""A copy of the workflow to run in, and the smoke DAG, run once by whichever worker of pytest-xdist is first."""

import fcntl
import os
import shutil
import subprocess
import sys
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path

import pytest

from mtcsirl.settings import Settings
from mtcsirl.settings.loading import load
from tests.dag.loaded import Loaded

SMOKE = ("--configfile", "config/smoke.yaml")
STUDY = ("results", "paper_figs")
Snakemake = Callable[..., subprocess.CompletedProcess[str]]


@pytest.fixture(scope="session")
def workspace(checkout: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A copy of everything that the workflow consists of, so that a test can edit it."""
    folder = tmp_path_factory.mktemp("dag") / "checkout"
    for name in ("workflow", "config", "profiles", "src"):
        shutil.copytree(checkout / name, folder / name, ignore=shutil.ignore_patterns("__pycache__", "*.egg-info"))
    shutil.copy(checkout / "Snakefile", folder)
    return folder


@pytest.fixture(scope="session")
def snakemake(workspace: Path) -> Snakemake:
    """Run snakemake in the workspace with the workspace's own package; extra arguments as on the command line."""

    def run(*arguments: str, cwd: Path = workspace) -> subprocess.CompletedProcess[str]:
        environment = os.environ | {"PYTHONPATH": str(workspace / "src"), "PYTHONDONTWRITEBYTECODE": "1"}
        command = [sys.executable, "-m", "snakemake", "--snakefile", str(workspace / "Snakefile"), *arguments]
        return subprocess.run(command, cwd=cwd, env=environment, capture_output=True, text=True, check=False)

    return run


@pytest.fixture(scope="session")
def loaded(workspace: Path) -> Iterator[Snakemake]:
    """As ``snakemake``, in half of the time, for what makes nothing: by a fork of a process with loaded libraries."""
    with Loaded(workspace / "src", workspace.parent / "said") as process:
        yield partial(_by, process, workspace)


@pytest.fixture(scope="session")
def planner(workspace: Path) -> Iterator[Snakemake]:
    """As ``loaded``, a third sooner, where no source is edited."""
    with Loaded(workspace / "src", workspace.parent / "planned", package=True) as process:
        yield partial(_by, process, workspace)


def _by(process: Loaded, workspace: Path, *words: str, cwd: Path | None = None) -> subprocess.CompletedProcess[str]:
    return process.snakemake(["--snakefile", str(workspace / "Snakefile"), *words], cwd or workspace)


@pytest.fixture(scope="session")
def smoke_settings() -> Settings:
    return load(scale="smoke")


@pytest.fixture(scope="session")
def smoke(workspace: Path, snakemake: Snakemake, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The workspace after the whole DAG ran at smoke scale: here, or in another worker, which leaves a copy."""
    base = tmp_path_factory.getbasetemp()
    made = (base.parent if "PYTEST_XDIST_WORKER" in os.environ else base) / "smoke"
    with open(made.with_suffix(".lock"), "w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        if made.exists():
            for name in STUDY:
                shutil.copytree(made / name, workspace / name)
        else:
            done = snakemake("--cores", "2", *SMOKE)
            assert done.returncode == 0, done.stderr[-8000:]
            for name in STUDY:
                shutil.copytree(workspace / name, made.with_suffix(".part") / name)
            made.with_suffix(".part").rename(made)
    return workspace


def job_counts(done: subprocess.CompletedProcess[str]) -> dict[str, int]:
    """Jobs per rule that a dry run announces; none if there is nothing to be done."""
    assert done.returncode == 0, done.stderr[-4000:]
    text = done.stdout + done.stderr
    if "Nothing to be done" in text:
        return {}
    lines = text.split("Job stats:\n", 1)[1].splitlines()
    rows = [line.split() for line in lines[2 : next(i for i, line in enumerate(lines) if line.startswith("total"))]]
    return {name: int(count) for name, count in rows}
