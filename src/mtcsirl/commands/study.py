"""The verbs that look at a study from outside: what it costs, how far it is, what its settings are."""

import argparse
import json
from pathlib import Path

from mtcsirl.commands.arguments import Verbs, add_study_settings, add_verb, study_settings
from mtcsirl.design import ARTEFACTS
from mtcsirl.errors import UserError


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
    plan.add_argument("--target", type=_artefact, metavar="NAME", help="one artefact, for example figure_3")
    plan.add_argument("--cores", type=int, default=2, metavar="N", help="cores to spread the jobs over; default 2")
    add_study_settings(plan)

    status = add_verb(
        verbs,
        "status",
        _status,
        does="print how far a study is: done, running, failed, gates passed, time left",
        needs="the study's results folder, finished or not",
        writes="nothing",
    )
    status.add_argument("--target", type=_artefact, metavar="NAME", help="one artefact, for example figure_3")
    status.add_argument("--cores", type=int, default=2, metavar="N", help="cores for the time left; default 2")
    add_study_settings(status)

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
        does="print the configuration: with its comments, as JSON, as JSON schema, or only check it",
        needs="nothing",
        writes="nothing",
    )
    settings.add_argument("form", choices=("template", "json", "schema", "check"))
    add_study_settings(settings)

    calibrate = add_verb(
        verbs,
        "calibrate",
        _calibrate,
        does="measure this machine's rates, one core, about a minute",
        needs="an idle core",
        writes="the file that plan reads, --output",
    )
    calibrate.add_argument("--output", type=Path, required=True, metavar="FILE", help="a JSON file")


def _artefact(name: str) -> str:
    if name not in ARTEFACTS:
        raise argparse.ArgumentTypeError(f"unknown artefact {name!r}; allowed: {', '.join(ARTEFACTS)}")
    return name


def _plan(parsed: argparse.Namespace) -> None:
    raise UserError("plan: not built yet")


def _status(parsed: argparse.Namespace) -> None:
    raise UserError("status: not built yet")


def _deviations(parsed: argparse.Namespace) -> None:
    from mtcsirl.settings.template import deviations

    for deviation in deviations(study_settings(parsed)):
        print(deviation)


def _settings(parsed: argparse.Namespace) -> None:
    from mtcsirl.settings.template import schema, template

    settings = study_settings(parsed)
    if parsed.form == "template":
        print(template(settings), end="")
    elif parsed.form == "json":
        print(settings.model_dump_json(indent=2))
    elif parsed.form == "schema":
        print(json.dumps(schema(), indent=2))
    else:
        print(f"valid: scale {settings.scale}")


def _calibrate(parsed: argparse.Namespace) -> None:
    raise UserError("calibrate: not built yet")
