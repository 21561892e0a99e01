"""The verb that says how far a study is, once or again and again."""

import argparse
import shutil
import sys
import time
from collections.abc import Sequence
from contextlib import suppress
from typing import TYPE_CHECKING

from mtcsirl.commands.arguments import Verbs, add_artefact, add_study_settings, add_verb, positive, study_settings
from mtcsirl.files.stop import Stopped
from mtcsirl.study.design import design

if TYPE_CHECKING:
    from mtcsirl.settings import Settings
    from mtcsirl.study.status import RunStatus

ALL_DONE = "all runs are done"


def register(verbs: Verbs) -> None:
    """Add the verb."""
    status = add_verb(
        verbs,
        "status",
        _status,
        does="print how far a study is: done, running, failed, gates passed, time left",
        needs="the study's results folder, finished or not",
        writes="nothing",
    )
    add_artefact(status)
    status.add_argument("--cores", type=positive, default=2, metavar="N", help="cores for the time left; default 2")
    status.add_argument(
        "--watch",
        type=positive,
        nargs="?",
        const=5,
        metavar="SECONDS",
        help="again every SECONDS (default 5) until all is done: one screen on a terminal, a line per change in a file",
    )
    add_study_settings(status)


def _status(parsed: argparse.Namespace) -> None:
    from mtcsirl.study.status import study_status

    settings = study_settings(parsed)
    if parsed.watch is not None:
        with suppress(Stopped):  # the usual end of watching
            _watch(parsed, settings)
        return
    statuses = study_status(design(settings, parsed.target), settings)
    print("\n".join([*_status_lines(statuses), "", _left(statuses, settings, parsed.cores)]))


def _watch(parsed: argparse.Namespace, settings: "Settings") -> None:
    from mtcsirl.study.screen import short
    from mtcsirl.study.status import study_status

    study, before = design(settings, parsed.target), ""
    while True:
        statuses = study_status(study, settings)
        left = _left(statuses, settings, parsed.cores)
        if sys.stdout.isatty():
            columns, rows = shutil.get_terminal_size()
            shown = [time.strftime("%H:%M:%S ") + left, *_status_lines(statuses)][: rows - 1]
            print("\x1b[H\x1b[2J" + "\n".join(short(line, max(columns - 1, 20)) for line in shown), flush=True)
        elif (counts := _counts(statuses)) != before:
            print(f"{time.strftime('%H:%M:%S')} {counts}; {left}", flush=True)
            before = counts
        if left == ALL_DONE:
            return
        time.sleep(parsed.watch)


def _left(statuses: "list[RunStatus]", settings: "Settings", cores: int) -> str:
    from mtcsirl.study.rates import load_rates
    from mtcsirl.study.screen import duration
    from mtcsirl.study.status import seconds_left

    left = seconds_left(statuses, settings, load_rates(), cores)
    return f"time left on {cores} cores: about {duration(left)}" if left else ALL_DONE


def _counts(statuses: "list[RunStatus]") -> str:
    from mtcsirl.study.status import STATES

    states = [status.state for status in statuses]
    return f"of {len(states)} runs " + ", ".join(f"{states.count(state)} {state}" for state in STATES)


def _status_lines(statuses: "list[RunStatus]") -> list[str]:
    """Stages with their counts, then what runs, failed or is stale, each with what it says."""
    from mtcsirl.study.standing import STALE
    from mtcsirl.study.status import FAILED, RUNNING, STATES

    lines = []
    for stage in dict.fromkeys(status.run.stage for status in statuses):
        own = [status for status in statuses if status.run.stage == stage]
        gates = [status.passed for status in own if status.passed is not None]
        counts = [sum(status.state == state for status in own) for state in STATES]
        lines.append((stage, *counts, f"{sum(gates)} of {len(gates)}" if gates else ""))
    said = [
        f"{state}: {status.run.folder}: {status.says}"
        for state in (RUNNING, FAILED, STALE)
        for status in statuses
        if status.state == state
    ]
    return [*aligned(("stage", *STATES, "gates passed"), lines), *said]


def aligned(head: tuple[str, ...], rows: Sequence[tuple[object, ...]]) -> list[str]:
    """Columns aligned: the first to the left, numbers to the right."""
    texts = [tuple(map(str, row)) for row in (head, *rows)]
    widths = [max(len(row[i]) for row in texts) for i in range(len(head))]
    lines = []
    for row in texts:
        rest = [text.rjust(width) for text, width in zip(row[1:], widths[1:], strict=True)]
        lines.append("  ".join((row[0].ljust(widths[0]), *rest)).rstrip())
    return lines
