"""The verbs that look at a study from outside: what it costs, how far it is, what its settings are."""

import argparse
import json
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from mtcsirl.commands import status
from mtcsirl.commands.arguments import (
    Verbs,
    add_artefact,
    add_study_settings,
    add_verb,
    new_file,
    path,
    positive,
    refusing,
    study_settings,
)
from mtcsirl.commands.status import aligned
from mtcsirl.errors import UserError
from mtcsirl.files.console import plain
from mtcsirl.study.ablations import ABLATIONS
from mtcsirl.study.design import ARTEFACTS, design

if TYPE_CHECKING:
    from mtcsirl.settings import Settings
    from mtcsirl.study.rates import Rates


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
    plan.add_argument("--cores", type=positive, default=2, metavar="N", help="cores that the jobs run on; default 2")
    plan.add_argument("--against-runs", action="store_true", help="hold it against the runs that are done, by stage")
    add_study_settings(plan)

    status.register(verbs)

    target = add_verb(
        verbs,
        "target",
        _target,
        does="print what to ask snakemake for to make runs: snakemake --cores 1 $(mtcsirl target sac/reach-wall-t0/s0)",
        needs="nothing",
        writes="nothing",
    )
    named = "folder of a run below the results, as mtcsirl status names it"
    target.add_argument("folders", nargs="+", metavar="RUN", help=named)
    add_study_settings(target)

    check = add_verb(
        verbs,
        "verify",
        _verify,
        does="check that every file of a results folder is what its run wrote, and say what to delete",
        needs="a results folder",
        writes="nothing",
    )
    check.add_argument("folder", type=path, metavar="FOLDER", help="for example results")

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
        does="measure this machine's rates, more than seven minutes",
        needs="a machine that has nothing else to do",
        writes="the file that plan reads, --output",
    )
    calibrate.add_argument("--output", type=rates_to_write, required=True, metavar="FILE", help="a JSON file")


def _plan(parsed: argparse.Namespace) -> None:
    from mtcsirl.settings.template import fallbacks
    from mtcsirl.study.plan import plan, wall_hours
    from mtcsirl.study.rates import CALIBRATION, load_rates

    settings, rates = study_settings(parsed), load_rates(parsed.rates or CALIBRATION)
    if parsed.against_runs:
        _print_spent(settings, parsed.target, rates, parsed.cores)
        return
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


def _print_spent(settings: "Settings", target: str | None, rates: "Rates", cores: int) -> None:
    """CPU seconds of done runs against those of the plan; its rates are of one machine, named below."""
    from mtcsirl.study.spent import spent

    lines = []
    for s in spent(design(settings, target), settings, rates, cores):
        ratios = f"{s.ratio:.2f}", f"{s.low:.2f} to {s.high:.2f}"
        lines.append((s.stage, s.made, s.runs, f"{s.planned:.1f}", f"{s.measured:.1f}", *ratios, s.processor))
    if not lines:
        raise UserError(f"{settings.results}: no run is done to hold the plan against; see mtcsirl status")
    head = ("stage", "made", "runs", "planned, s", "measured, s", "ratio", "5 % to 95 %", "processor")
    _print_table(head, lines)
    print(f"\nCPU seconds of a run without start-up, {cores} at once; planned by the rates of: {rates.machine}")


def _print_artefacts(settings: "Settings", rates: "Rates") -> None:
    """Jobs and core-hours of every artefact asked for alone; artefacts share runs, so these add up to more."""
    from mtcsirl.study.plan import plan

    lines = []
    for name in (*ARTEFACTS, *ABLATIONS):
        stages = plan(design(settings, name), settings, rates)
        lines.append((name, sum(s.jobs for s in stages), f"{sum(s.core_hours for s in stages):.1f}"))
    print("\neach artefact alone (they share runs; the total above is without ablations):")
    _print_table(("artefact", "jobs", "core-hours"), lines)


def _target(parsed: argparse.Namespace) -> None:
    with refusing():
        _print_targets(parsed)


def _print_targets(parsed: argparse.Namespace) -> None:
    from mtcsirl.files.identity import marker
    from mtcsirl.study.keys import identity_of

    settings = study_settings(parsed)
    results = Path(settings.results)
    runs = {run.folder: run for artefact in (None, *ABLATIONS) for run in design(settings, artefact)}
    names = []
    for folder in map(Path, parsed.folders):
        names.append((folder.relative_to(results) if folder.is_relative_to(results) else folder).as_posix())
        if names[-1] not in runs:
            raise UserError(f"{folder}: is no run of the study at scale {settings.scale}; see mtcsirl status")
    for name in names:
        print(results / name / marker(identity_of(runs[name], settings).hash))


def _verify(parsed: argparse.Namespace) -> None:
    from mtcsirl.study.verification import faults

    found = list(faults(parsed.folder))
    for fault in found:
        print(plain(f"delete {fault.path}: {fault.why}"))
    if found:
        raise UserError(f"{parsed.folder}: {len(found)} faults; delete what is listed and make it again")
    print(f"{parsed.folder}: every file is what its run wrote")


def _print_table(head: tuple[str, ...], rows: Sequence[tuple[object, ...]]) -> None:
    print("\n".join(aligned(head, rows)))


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
    from mtcsirl.study.rates import load_rates

    file = new_file(given)
    if file.exists():
        try:
            load_rates(file)
        except UserError as error:
            raise UserError(f"{file}: is there and holds no rates; choose another name") from error
    return file


def _calibrate(parsed: argparse.Namespace) -> None:
    from mtcsirl.calibration.measure import calibrate
    from mtcsirl.files.storage import write_json

    rates = calibrate()
    write_json(parsed.output, rates.model_dump(mode="json"))
    print(f"{parsed.output}: rates of {rates.machine}")
