"""`mtcsirl doctor`: what a machine lacks is said, what makes a study impossible ends it; each with its sibling."""

import subprocess
import sys
from pathlib import Path

import pytest

from mtcsirl.settings import Settings
from mtcsirl.settings.loading import load
from mtcsirl.study import readiness
from mtcsirl.study.design import design
from mtcsirl.study.rates import load_rates
from mtcsirl.study.readiness import BESIDE_RUNS_GIB, FAILS, LACKS, OK
from mtcsirl.study.runs import AnyRun
from tests.conftest import CHECKOUT
from tests.hidden import environment
from tests.study.made_up import finish

LOOKED_AT = ["python", "memory", "disk", "writing", "rendering", "videos", "threads", "locale", "commit"]


def doctor(folder: Path, *words: str, osmesa: bool = False, **variables: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "mtcsirl.cli", "doctor", "--scale", "smoke", "--cores", "1", *words]
    env = environment(folder / "site", CHECKOUT / "src", osmesa=osmesa) | variables
    return subprocess.run(command, env=env, cwd=CHECKOUT, capture_output=True, text=True, check=False)


def states(done: subprocess.CompletedProcess[str]) -> dict[str, str]:
    return {line.split()[0]: line.split()[1] for line in done.stdout.splitlines()}


@pytest.fixture
def settings(tmp_path: Path) -> Settings:
    return load((), (f"results={tmp_path / 'results'}", f"figures={tmp_path / 'figures'}"), "smoke")


@pytest.fixture
def left(settings: Settings) -> list[AnyRun]:
    return list(design(settings))


def test_a_bare_machine_is_told_the_remedy_and_may_go_on(tmp_path: Path) -> None:
    done = doctor(tmp_path)
    assert done.returncode == 0, done.stderr
    assert list(states(done)) == LOOKED_AT
    assert states(done)["rendering"] == LACKS
    assert "apt-get install libosmesa6" in done.stdout
    assert max(map(len, done.stdout.splitlines())) <= 200


def test_what_makes_a_study_impossible_ends_it(tmp_path: Path) -> None:
    done = doctor(tmp_path, "--set", "results=/proc/results")
    assert done.returncode == 2
    assert states(done)["writing"] == FAILS
    assert done.stderr.count("\n") == 1
    assert "impossible here: disk, writing" in done.stderr


def test_several_threads_a_job_and_an_old_alphabet_are_lacks(tmp_path: Path) -> None:
    done = doctor(tmp_path, OMP_NUM_THREADS="8", LC_ALL="POSIX", PYTHONUTF8="0", PYTHONCOERCECLOCALE="0")
    assert done.returncode == 0
    assert states(done) | {"threads": LACKS, "locale": LACKS} == states(done)
    assert "OMP_NUM_THREADS=8" in done.stdout


def test_python() -> None:
    assert readiness.python((3, 11, 2)).state == OK
    assert readiness.python((3, 10, 9)).state == FAILS


def test_memory(left: list[AnyRun], settings: Settings) -> None:
    states = [readiness.memory(left, settings, load_rates(), 4, mib).state for mib in (50_000, 900, 100)]
    assert states == [OK, LACKS, FAILS]
    huge = settings.model_copy(update={"sac": settings.sac.model_copy(update={"hidden_sizes": (10**6, 10**6)})})
    assert readiness.memory(left, huge, load_rates(), 1, 1e9).state == FAILS


def test_disk_counts_what_is_not_there_yet(left: list[AnyRun], settings: Settings) -> None:
    rates = load_rates()
    assert readiness.disk(left, settings, rates, 50.0).state == OK
    assert readiness.disk(left, settings, rates, 0.11).state == FAILS
    assert readiness.disk([], settings, rates, 0.11).state == OK, "all runs are there"


def test_a_stale_run_is_still_to_be_written(settings: Settings, left: list[AnyRun]) -> None:
    """Of a study that is done all but what tables and figures take is there; made with other steps, nothing is."""

    def said() -> str:
        found = readiness.findings(design(settings), settings, load_rates(), 1)
        return next(one.says for one in found if one.what == "disk").partition(", about ")[2]

    nothing_there = said()
    for run in left:
        finish(run, settings)
    assert said() == f"{BESIDE_RUNS_GIB} to be written" != nothing_there
    for run in left:
        finish(run, settings, steps=123)
    assert said() == nothing_there


def test_places_that_cannot_be_written(settings: Settings, tmp_path: Path) -> None:
    assert readiness.writing(settings).state == OK
    (tmp_path / "figures").write_text("a file")
    assert readiness.writing(settings).state == FAILS


def test_threads_letters_and_commit(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in readiness.ONE_THREAD:
        monkeypatch.setenv(name, "1")
    assert [readiness.threads(cores, 2).state for cores in (2, 3)] == [OK, LACKS]
    assert [readiness.letters(name).state for name in ("UTF-8", "utf8", "ANSI_X3.4-1968")] == [OK, OK, LACKS]
    assert [readiness.code(name).state for name in ("0123abc", "0123abc+", "unknown: no git")] == [OK, OK, LACKS]


def test_the_threads_are_those_that_jobs_set() -> None:
    from mtcsirl.cli import THREADS

    assert THREADS == readiness.ONE_THREAD


def test_make_asks_before_it_runs() -> None:
    makefile = (CHECKOUT / "Makefile").read_text()
    for target in ("replicate", "smoke"):
        recipe = makefile.split(f"\n{target}: setup")[1].split("\n\n")[0]
        assert recipe.index("mtcsirl doctor") < recipe.index("snakemake --cores"), target
