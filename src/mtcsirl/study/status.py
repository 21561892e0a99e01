"""How far a study is, read from its results folder while it runs or after: `mtcsirl status`."""

import time
from dataclasses import dataclass
from pathlib import Path

from mtcsirl.errors import UserError
from mtcsirl.files import storage
from mtcsirl.settings import Settings
from mtcsirl.study.outputs import OUTPUTS
from mtcsirl.study.plan import Rates, cost
from mtcsirl.study.runs import Run, Study

DONE, OUTDATED, RUNNING, FAILED, WAITING = STATES = ("done", "outdated", "running", "failed", "waiting")
"""Outdated: made with other settings than today's. Failed: was started, does not run and left no complete result."""
STARTING_SECONDS = 15
"""A log this young without a lock is a job that still imports its libraries."""


@dataclass(frozen=True)
class RunStatus:
    """One run: its state, its gate (None: not done, or has none), the seconds it took, the last line of its log."""

    run: Run
    state: str
    passed: bool | None = None
    seconds: float | None = None
    says: str = ""


def study_status(study: Study, settings: Settings) -> list[RunStatus]:
    """The status of every run of ``study``, in the DAG's order."""
    return [run_status(run, settings) for run in study]


def run_status(run: Run, settings: Settings) -> RunStatus:
    """Look into the folder of ``run`` and its log."""
    folder = Path(settings.results) / run.folder
    log = Path(settings.results) / "logs" / f"{run.folder}.log"
    if storage.is_locked(folder):
        return RunStatus(run, RUNNING, says=_last_line(log))
    if all((folder / name).is_file() for name in OUTPUTS[run.stage]):
        return _finished(run, settings, folder)
    if not log.is_file():
        return RunStatus(run, WAITING)
    starting = time.time() - log.stat().st_mtime < STARTING_SECONDS
    return RunStatus(run, RUNNING if starting else FAILED, says=_last_line(log))


def seconds_left(statuses: list[RunStatus], settings: Settings, rates: Rates, cores: int) -> float:
    """Wall seconds for what is not done: the mean of the stage's done runs, or the plan's estimate before any is."""
    took: dict[str, list[float]] = {}
    for status in statuses:
        if status.state == DONE and status.seconds is not None:
            took.setdefault(status.run.stage, []).append(status.seconds)
    total = 0.0
    for status in statuses:
        if status.state != DONE:
            known = took.get(status.run.stage)
            total += sum(known) / len(known) if known else rates.slowdown * cost(status.run, settings, rates).seconds
    return total / cores


def _finished(run: Run, settings: Settings, folder: Path) -> RunStatus:
    try:
        same = storage.read_json(folder / "settings.json") == run.settings(settings).model_dump(mode="json")
        seconds = storage.read_json(folder / "provenance.json")["cost"]["wall_seconds"]
        gate = storage.read_json(folder / "gate.json") if "gate.json" in OUTPUTS[run.stage] else {}
    except (UserError, KeyError, TypeError) as error:
        return RunStatus(run, FAILED, says=str(error))
    return RunStatus(run, DONE if same else OUTDATED, gate.get("passed"), seconds)


def _last_line(log: Path) -> str:
    lines = log.read_text(encoding="utf-8", errors="replace").split("\n") if log.is_file() else []
    return next((line.strip() for line in reversed(lines) if line.strip()), "")
