"""What a study needs of the machine, looked at before it runs: one finding each, with the way out. `mtcsirl doctor`."""

import locale
import os
import shutil
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path

import psutil

from mtcsirl.errors import UserError
from mtcsirl.files.provenance import commit
from mtcsirl.files.storage import check_writable
from mtcsirl.settings import Settings
from mtcsirl.settings.machine import check_study
from mtcsirl.study.memory import BASE
from mtcsirl.study.plan import plan
from mtcsirl.study.rates import Rates
from mtcsirl.study.runs import AnyRun, Runs
from mtcsirl.study.standing import DONE, standing
from mtcsirl.worlds.drawable import lacking

OK, LACKS, FAILS = "ok", "lacks", "fails"
"""Lacks: the study ends well without it. Fails: the study is impossible."""
OLDEST_PYTHON = (3, 11)
ONE_THREAD = ("OMP_NUM_THREADS", "MKL_NUM_THREADS", "OPENBLAS_NUM_THREADS")
BESIDE_RUNS_GIB = 0.1
"""Logs, tables, figures and report."""


@dataclass(frozen=True)
class Finding:
    """One line."""

    what: str
    state: str
    says: str


def findings(study: Runs, settings: Settings, rates: Rates, cores: int) -> Iterator[Finding]:
    """Everything that is looked at, for a study on ``cores`` cores of this machine."""
    left = [run for run in study if standing(run, settings).state != DONE]
    yield python(sys.version_info[:3])
    yield memory(left, settings, rates, cores, psutil.virtual_memory().available / 2**20)
    yield disk(left, settings, rates, shutil.disk_usage(existing(Path(settings.results))).free / 2**30)
    yield writing(settings)
    yield rendering(lacking())
    yield videos()
    yield threads(cores, len(os.sched_getaffinity(0)))
    yield letters(locale.getpreferredencoding(False))
    yield code(commit())


def python(version: tuple[int, ...]) -> Finding:
    """The version of Python."""
    said = ".".join(map(str, version))
    if version < OLDEST_PYTHON:
        return Finding("python", FAILS, f"{said}: 3.11 or newer is needed: make PYTHON=python3.11 ...")
    return Finding("python", OK, said)


def memory(left: list[AnyRun], settings: Settings, rates: Rates, cores: int, free_mib: float) -> Finding:
    """The memory that is free against the largest jobs of the plan, ``cores`` at once."""
    largest = max((stage.memory_mib for stage in plan(left, settings, rates)), default=BASE)
    said = f"{free_mib:,.0f} MiB free; a job takes up to {largest:,.0f}, {cores} at once {cores * largest:,.0f}"
    try:
        check_study(settings)
    except UserError as error:
        return Finding("memory", FAILS, str(error))
    if free_mib < largest:
        return Finding("memory", FAILS, f"{said}; end other programs, or use a machine with more")
    if free_mib < cores * largest:
        return Finding("memory", LACKS, f"{said}; use fewer: --cores {max(int(free_mib // largest), 1)}")
    return Finding("memory", OK, said)


def disk(left: list[AnyRun], settings: Settings, rates: Rates, free_gib: float) -> Finding:
    """The free disk against what the runs that are not there yet will write."""
    needed = sum(stage.disk_gib for stage in plan(left, settings, rates)) + BESIDE_RUNS_GIB
    said = f"{free_gib:,.1f} GiB free at {settings.results}, about {needed:,.1f} to be written"
    if free_gib < needed:
        return Finding("disk", FAILS, f"{said}; make room there, or name another place: results: FOLDER")
    return Finding("disk", OK, said)


def writing(settings: Settings) -> Finding:
    """Whether results and figures can be written."""
    places = (settings.results, settings.figures)
    try:
        for place in places:
            check_writable(Path(place), folder=True)
    except UserError as error:
        return Finding("writing", FAILS, str(error))
    return Finding("writing", OK, " and ".join(places))


def rendering(lack: str | None) -> Finding:
    """Whether pictures of scenes can be drawn."""
    if lack is None:
        return Finding("rendering", OK, "figures 8 and 9, videos")
    return Finding("rendering", LACKS, f"figures 8 and 9 will be words, videos are not made: {lack}")


def videos() -> Finding:
    """Whether videos can be MP4."""
    if find_spec("imageio_ffmpeg") is None:
        return Finding("videos", LACKS, "GIF alone, no MP4 (no part of the study): pip install 'mtcsirl[video]'")
    return Finding("videos", OK, "GIF and MP4")


def threads(cores: int, there: int) -> Finding:
    """Whether jobs share the cores: one thread each, and no more jobs than cores."""
    many = [f"{name}={os.environ[name]}" for name in ONE_THREAD if os.environ.get(name, "1") != "1"]
    if many:
        return Finding("threads", LACKS, f"{', '.join(many)}: jobs would fight for {there} cores; unset it")
    if cores > there:
        return Finding("threads", LACKS, f"{cores} jobs at once on {there} cores are slower: --cores {there}")
    return Finding("threads", OK, f"one per job, {cores} jobs at once, {there} cores")


def letters(encoding: str) -> Finding:
    """Whether messages keep their letters."""
    if encoding.lower().replace("-", "") != "utf8":
        return Finding("locale", LACKS, f"{encoding}: some letters of messages become ?; export LC_ALL=C.UTF-8")
    return Finding("locale", OK, encoding)


def code(known: str) -> Finding:
    """Whether provenance will name the commit."""
    if known.startswith("unknown"):
        return Finding("commit", LACKS, f"{known}; provenance will not name it")
    return Finding("commit", OK, f"{known[:12]}, with changes that are not committed" if "+" in known else known[:12])


def existing(place: Path) -> Path:
    """``place``, or the nearest folder above it that is there."""
    place = place.absolute()
    return place if place.exists() else existing(place.parent)
