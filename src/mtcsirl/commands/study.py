"""The verbs that look at a study from outside: what it costs, how far it is, what its settings are."""

import argparse
import json
import shutil
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from mtcsirl.commands.arguments import (
    Verbs,
    add_artefact,
    add_study_settings,
    add_verb,
    new_file,
    path,
    positive,
    study_settings,
)
from mtcsirl.errors import UserError
from mtcsirl.study.ablations import ABLATIONS
from mtcsirl.study.design import ARTEFACTS, design

if TYPE_CHECKING:
    from mtcsirl.settings import Settings
    from mtcsirl.study.plan import Rates
    from mtcsirl.study.status import RunStatus

ALL_DONE = "all runs are done"


def register(verbs: Verbs) -> None:
    """Add the verbs."""
    plan = add_verb(
        verbs,
        "plan",
        _plan,
        does="print jobs, core-hours, wall time, memory and disk of a study or of one artefact, before it runs",
        needs="the rates of this machine, or those that ship with the package (see calibrate)",
        writes="nothing",
    )
    add_artefact(plan)
    plan.add_argument("--rates", type=path, default=None, metavar="FILE", help="what calibrate wrote; default: shipped")
    plan.add_argument("--cores", type=positive, default=2, metavar="N", help="cores to spread the jobs over; default 2")
    add_study_settings(plan)

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

    target = add_verb(
        verbs,
        "target",
        _target,
        does="print what to ask snakemake for to make one run: snakemake --cores 1 $(mtcsirl target sac/reach-t0/s0)",
        needs="nothing",
        writes="nothing",
    )
    target.add_argument("folder", metavar="RUN", help="folder of the run below the results, as mtcsirl status names it")
    add_study_settings(target)

    check = add_verb(
        verbs,
        "verify",
        _verify,
        does="check that every file of a results folder is what its run wrote, and say what to delete",
        needs="a results folder",
        writes="nothing",
    )
    check.add_argument("folder", type=Path, metavar="FOLDER", help="for example results")

    differences = add_verb(
        verbs,
        "deviations",
        _deviations,
        does="print every setting that differs from the paper's value",
        needs="nothing",
        writes="nothing",
    )
    add_study_settings(differences)

    settings = add_verb(
        verbs,
        "settings",
        _settings,
        does="print the configuration (template: with comments; defaults: the classes') or check it",
        needs="nothing",
        writes="nothing",
    )
    settings.add_argument("form", choices=("template", "json", "schema", "defaults", "check"))
    add_study_settings(settings)

    calibrate = add_verb(
        verbs,
        "calibrate",
        _calibrate,
        does="measure this machine's rates, about two minutes",
        needs="a machine that has nothing else to do",
        writes="the file that plan reads, --output",
    )
    calibrate.add_argument("--output", type=rates_to_write, required=True, metavar="FILE", help="a JSON file")


def _plan(parsed: argparse.Namespace) -> None:
    from mtcsirl.settings.template import fallbacks
    from mtcsirl.study.plan import CALIBRATION, load_rates, plan, wall_hours

    settings, rates = study_settings(parsed), load_rates(parsed.rates or CALIBRATION)
    stages = plan(design(settings, parsed.target), settings, rates)
    lines = [
        (s.stage, s.jobs, f"{s.core_hours:.1f}", f"{s.longest_minutes:.1f}", f"{s.memory_mib:.0f}", f"{s.disk_gib:.2f}")
        for s in stages
    ]
    total = (sum(s.jobs for s in stages), sum(s.core_hours for s in stages), sum(s.disk_gib for s in stages))
    lines.append(("total", total[0], f"{total[1]:.1f}", "", "", f"{total[2]:.2f}"))
    _print_table(("stage", "jobs", "core-hours", "longest job, min", "memory, MiB", "disk, GiB"), lines)
    print(f"\nscale {settings.scale}: {wall_hours(stages, parsed.cores):.1f} hours on {parsed.cores} cores")
    print(f"rates measured on: {rates.machine}")
    for note in fallbacks(settings):
        print(note)
    if parsed.target is None:
        _print_artefacts(settings, rates)


def _print_artefacts(settings: "Settings", rates: "Rates") -> None:
    """Jobs and core-hours of every artefact asked for alone; artefacts share runs, so these add up to more."""
    from mtcsirl.study.plan import plan

    lines = []
    for name in (*ARTEFACTS, *ABLATIONS):
        stages = plan(design(settings, name), settings, rates)
        lines.append((name, sum(s.jobs for s in stages), f"{sum(s.core_hours for s in stages):.1f}"))
    print("\neach artefact alone (they share runs; the total above is without ablations):")
    _print_table(("artefact", "jobs", "core-hours"), lines)


def _status(parsed: argparse.Namespace) -> None:
    from mtcsirl.study.screen import short
    from mtcsirl.study.status import study_status

    settings = study_settings(parsed)
    study, before = design(settings, parsed.target), ""
    while True:
        statuses = study_status(study, settings)
        left = _left(statuses, settings, parsed.cores)
        if parsed.watch is None:
            print("\n".join([*_status_lines(statuses), "", left]))
            return
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
    from mtcsirl.study.plan import load_rates
    from mtcsirl.study.status import seconds_left

    left = seconds_left(statuses, settings, load_rates(), cores)
    return f"time left on {cores} cores: about {left / 3600:.1f} hours" if left else ALL_DONE


def _counts(statuses: "list[RunStatus]") -> str:
    from mtcsirl.study.status import STATES

    states = [status.state for status in statuses]
    return f"of {len(states)} runs " + ", ".join(f"{states.count(state)} {state}" for state in STATES)


def _status_lines(statuses: "list[RunStatus]") -> list[str]:
    """Stages with their counts, then what runs, failed or is stale, each with what it says."""
    from mtcsirl.study.status import FAILED, RUNNING, STALE, STATES

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
    return [*_table(("stage", *STATES, "gates passed"), lines), *said]


def _target(parsed: argparse.Namespace) -> None:
    from mtcsirl.files.identity import marker
    from mtcsirl.study.keys import identity_of

    settings = study_settings(parsed)
    results = Path(settings.results)
    folder = Path(parsed.folder)
    name = (folder.relative_to(results) if folder.is_relative_to(results) else folder).as_posix()
    runs = {run.folder: run for artefact in (None, *ABLATIONS) for run in design(settings, artefact)}
    if name not in runs:
        raise UserError(f"{parsed.folder}: is no run of the study at scale {settings.scale}; see mtcsirl status")
    print(results / name / marker(identity_of(runs[name], settings).hash))


def _verify(parsed: argparse.Namespace) -> None:
    from mtcsirl.study.verification import faults

    found = list(faults(parsed.folder))
    for fault in found:
        print(f"delete {fault.path}: {fault.why}")
    if found:
        raise UserError(f"{parsed.folder}: {len(found)} faults; delete what is listed and make it again")
    print(f"{parsed.folder}: every file is what its run wrote")


def _print_table(head: tuple[str, ...], rows: Sequence[tuple[object, ...]]) -> None:
    print("\n".join(_table(head, rows)))


def _table(head: tuple[str, ...], rows: Sequence[tuple[object, ...]]) -> list[str]:
    """Columns aligned: the first to the left, numbers to the right."""
    texts = [tuple(map(str, row)) for row in (head, *rows)]
    widths = [max(len(row[i]) for row in texts) for i in range(len(head))]
    lines = []
    for row in texts:
        rest = [text.rjust(width) for text, width in zip(row[1:], widths[1:], strict=True)]
        lines.append("  ".join((row[0].ljust(widths[0]), *rest)).rstrip())
    return lines


def _deviations(parsed: argparse.Namespace) -> None:
    from mtcsirl.settings.template import deviations

    for deviation in deviations(study_settings(parsed)):
        print(deviation)


def _settings(parsed: argparse.Namespace) -> None:
    from mtcsirl.settings.machine import check_study
    from mtcsirl.settings.template import fallbacks, schema, template

    if parsed.form == "defaults":
        print(template(), end="")
        return
    settings = study_settings(parsed)
    if parsed.form == "template":
        print(template(settings), end="")
    elif parsed.form == "json":
        print(settings.model_dump_json(indent=2))
    elif parsed.form == "schema":
        print(json.dumps(schema(), indent=2))
    else:
        check_study(settings)
        print(f"valid: scale {settings.scale}")
        for note in fallbacks(settings):
            print(note)


def rates_to_write(given: str) -> Path:
    """A file for rates: a new one, or one that holds rates already."""
    from mtcsirl.study.plan import load_rates

    file = new_file(given)
    if file.exists():
        try:
            load_rates(file)
        except UserError as error:
            raise UserError(f"{file}: is there and holds no rates; choose another name") from error
    return file


def _calibrate(parsed: argparse.Namespace) -> None:
    from mtcsirl.files.storage import write_json
    from mtcsirl.study.calibration import calibrate

    rates = calibrate()
    write_json(parsed.output, rates.model_dump(mode="json"))
    print(f"{parsed.output}: rates of {rates.machine}")
