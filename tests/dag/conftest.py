"""A copy of the workflow to run in, and the smoke DAG, run once per session."""

import os
import shutil
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from mtcsirl.settings import Settings
from mtcsirl.settings.loading import load

SMOKE = ("--configfile", "config/smoke.yaml")
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
def smoke_settings() -> Settings:
    return load(scale="smoke")


@pytest.fixture(scope="session")
def smoke(workspace: Path, snakemake: Snakemake) -> Path:
    """The workspace after the whole DAG ran at smoke scale."""
    done = snakemake("--cores", "2", *SMOKE)
    assert done.returncode == 0, done.stderr[-8000:]
    return workspace


@pytest.fixture
def edit(workspace: Path) -> Iterator[Callable[[str], None]]:
    """Append a comment to a module of the workspace's package, and take it back after the test."""
    kept: dict[Path, bytes] = {}

    def append(module: str) -> None:
        path = workspace / "src/mtcsirl" / module
        kept[path] = path.read_bytes()
        path.write_bytes(kept[path] + b"\n# edited\n")

    yield append
    for path, content in kept.items():
        path.write_bytes(content)


def job_counts(done: subprocess.CompletedProcess[str]) -> dict[str, int]:
    """Jobs per rule that a dry run announces; none if there is nothing to be done."""
    assert done.returncode == 0, done.stderr[-4000:]
    text = done.stdout + done.stderr
    if "Nothing to be done" in text:
        return {}
    lines = text.split("Job stats:\n", 1)[1].splitlines()
    rows = [line.split() for line in lines[2 : next(i for i, line in enumerate(lines) if line.startswith("total"))]]
    return {name: int(count) for name, count in rows}
