"""How far a study is: once, watched, and in one line before a workflow starts."""

import os
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path

import pytest

from mtcsirl.files import storage
from mtcsirl.files.identity import FILE, Record, checksums, dumps, result_files
from mtcsirl.settings import Settings
from mtcsirl.settings.loading import load
from mtcsirl.study.design import design
from mtcsirl.study.keys import Run, identity_of
from mtcsirl.study.outputs import OUTPUTS
from mtcsirl.study.status import before_it_starts
from tests.conftest import CHECKOUT


@pytest.fixture
def settings(tmp_path: Path) -> Settings:
    return load((), (f"results={tmp_path / 'results'}", "seeds=[0]", "irl_seeds=[0]"), "smoke")


def finish(run: Run, settings: Settings, **other: object) -> None:
    """Leave what a run leaves; ``other``: settings that were other ones when it ran."""
    folder = Path(settings.results) / run.folder
    for name in OUTPUTS[run.stage]:
        storage.write_text(folder / name, "{}")
    storage.write_json(folder / "provenance.json", {"cost": {"wall_seconds": 3.0}})
    storage.write_json(folder / "gate.json", {"passed": True})
    identity = identity_of(run, settings)
    identity = replace(identity, settings=dict(identity.settings) | other)
    record = Record(identity, checksums(folder, result_files(folder)), {})
    storage.write_text(folder / FILE, dumps(record))


def test_a_line_says_what_is_done_stale_and_why(settings: Settings) -> None:
    study = design(settings)
    runs = list(study)
    assert before_it_starts(study, settings) == f"{settings.results}: of {len(runs)} runs 0 done"
    first, second, third, fourth = study.baselines[:4]
    finish(first, settings)
    for run in (second, third):
        finish(run, settings, steps=123)
    finish(fourth, settings)
    (Path(settings.results) / fourth.folder / "curve.csv").unlink()
    line = before_it_starts(study, settings)
    assert f"of {len(runs)} runs 1 done, 2 stale, 1 incomplete (2 x steps: 123 -> " in line
    assert "\n" not in line


def watch(settings: Settings) -> subprocess.Popen[str]:
    command = [sys.executable, "-m", "mtcsirl.cli", "status", "--watch", "1", "--settings", settings.model_dump_json()]
    env = os.environ | {"PYTHONPATH": str(CHECKOUT / "src")}
    return subprocess.Popen(command, env=env, text=True, stdout=subprocess.PIPE, stderr=subprocess.PIPE)


def test_a_watched_study_is_a_line_per_change_in_a_file_and_ends_with_it(settings: Settings) -> None:
    runs = list(design(settings))
    for run in runs[:-1]:
        finish(run, settings)
    watched = watch(settings)
    assert watched.stdout is not None
    first = watched.stdout.readline()
    assert f"of {len(runs)} runs {len(runs) - 1} done, 0 stale, 0 running, 0 failed, 1 waiting; time left" in first
    time.sleep(2.5)
    assert watched.poll() is None, "it goes on while a run is missing"
    finish(runs[-1], settings)
    rest, error = watched.communicate(timeout=60)
    assert watched.returncode == 0, error
    assert rest.count("\n") == 1, "nothing is said twice"
    assert rest.endswith("0 waiting; all runs are done\n")
