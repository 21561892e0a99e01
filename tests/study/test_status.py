"""How far a study is: once, watched, and in one line before a workflow starts."""

import os
import pty
import signal
import subprocess
import sys
import time
from contextlib import suppress
from dataclasses import replace
from pathlib import Path

import pytest

from mtcsirl.files import storage
from mtcsirl.files.identity import FILE, checksums, dumps, read_record, result_files
from mtcsirl.settings import Settings
from mtcsirl.study.design import design
from mtcsirl.study.standing import DONE, STALE
from mtcsirl.study.status import FAILED, before_it_starts, run_status
from tests.conftest import CHECKOUT, HEEDING
from tests.study.made_up import finish


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


def test_a_run_whose_input_was_made_again_is_stale_whatever_its_log_says(settings: Settings) -> None:
    demonstrations = next(iter(design(settings).irl_runs)).demonstrations[0]
    finish(demonstrations.expert, settings)
    folder = Path(settings.results) / demonstrations.folder
    finish(demonstrations, settings)
    record = read_record(folder)
    assert record is not None
    storage.write_text(folder / FILE, dumps(replace(record, read=dict.fromkeys(demonstrations.needs, "0" * 16))))
    log = Path(settings.results) / "logs" / demonstrations.folder / f"{record.identity.hash}.log"
    storage.write_text(log, "collected\n")
    os.utime(log, (1, 1))
    found = run_status(demonstrations, settings)
    assert (found.state, found.says) == (STALE, "input expert: made again with other bytes")


def test_a_stale_run_names_its_first_reasons_and_counts_the_rest(settings: Settings) -> None:
    first, second = design(settings).baselines[:2]
    finish(first, settings, steps=123)
    finish(second, settings, steps=123, **{f"a{number}": "x" * 300 for number in range(9)})
    few, many = (run_status(run, settings) for run in (first, second))
    assert (few.state, many.state) == (STALE, STALE)
    assert few.says.startswith("steps: 123 -> ")
    assert "more" not in few.says
    assert many.says.startswith("a0: xxx")
    assert many.says.endswith("; and 7 more")
    assert many.says.count("; ") == 3
    assert len(many.says) < 300


@pytest.mark.parametrize(
    ("name", "said", "says"),
    [
        ("provenance.json", {"commit": "x"}, "lacks cost.cpu_seconds; delete its folder and make it again"),
        ("provenance.json", {"cost": {"cpu_seconds": "1"}}, "cost.cpu_seconds is '1', not a number; delete its folder"),
        ("gate.json", {}, "gate.json: changed since its run wrote it"),
    ],
)
def test_a_damaged_run_says_which_file_and_what_to_do(settings: Settings, name: str, said: object, says: str) -> None:
    run = design(settings).baselines[0]
    finish(run, settings)
    assert run_status(run, settings).state == DONE
    path = Path(settings.results) / run.folder / name
    storage.write_json(path, said)
    found = run_status(run, settings)
    assert found.state == FAILED
    assert found.says.startswith(f"{path}: ")
    assert says in found.says


def test_a_signed_gate_that_is_none_is_named(settings: Settings) -> None:
    run = design(settings).baselines[0]
    finish(run, settings)
    folder = Path(settings.results) / run.folder
    record = read_record(folder)
    assert record is not None
    for said, says in (({}, "lacks passed"), ({"passed": None}, "passed is 'None', not true or false")):
        storage.write_json(folder / "gate.json", said)
        storage.write_text(folder / FILE, dumps(replace(record, files=checksums(folder, result_files(folder)))))
        assert says in run_status(run, settings).says


def watch(settings: Settings) -> subprocess.Popen[str]:
    command = [sys.executable, "-m", "mtcsirl.cli", "status", "--watch", "1", "--settings", settings.model_dump_json()]
    env = os.environ | {"PYTHONPATH": str(CHECKOUT / "src")}
    return subprocess.Popen(command, env=env, text=True, stdout=subprocess.PIPE, stderr=subprocess.PIPE)


@pytest.mark.slow
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


def test_on_a_terminal_the_screen_is_cleared_and_ctrl_c_ends_it(settings: Settings) -> None:
    main, side = pty.openpty()
    command = [sys.executable, "-m", "mtcsirl.cli", "status", "--watch", "1", "--settings", settings.model_dump_json()]
    env = os.environ | {"PYTHONPATH": str(CHECKOUT / "src"), "COLUMNS": "60", "LINES": "20"}
    watched = subprocess.Popen(command, env=env, stdin=side, stdout=side, stderr=side, **HEEDING)
    os.close(side)
    read = b""
    while read.count(b"\x1b[2J") < 2:
        read += os.read(main, 4096)
    watched.send_signal(signal.SIGINT)
    with suppress(OSError):  # Linux's way to say that nobody holds the other end
        while more := os.read(main, 4096):
            read += more
    os.close(main)
    assert watched.wait(timeout=60) == 0
    screen = read.decode().split("\x1b[2J")[1].splitlines()
    assert len(screen) < 20
    assert max(map(len, screen)) < 70
    assert any(line.startswith("train_expert") for line in screen)
