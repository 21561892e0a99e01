"""The verb that looks at the machine before a study runs."""

import argparse

from mtcsirl.commands.arguments import Verbs, add_study_settings, add_verb, positive, study_settings
from mtcsirl.errors import UserError
from mtcsirl.study.design import design


def register(verbs: Verbs) -> None:
    """Add the verb."""
    verb = add_verb(
        verbs,
        "doctor",
        _doctor,
        does="say what this machine lacks for a study: Python, memory, disk, rendering, threads, locale; "
        "exit 2 for what makes the study impossible",
        needs="nothing",
        writes="nothing",
    )
    verb.add_argument("--cores", type=positive, default=2, metavar="N", help="jobs at once; default 2")
    add_study_settings(verb)


def _doctor(parsed: argparse.Namespace) -> None:
    from mtcsirl.study.rates import load_rates
    from mtcsirl.study.readiness import FAILS, findings
    from mtcsirl.study.screen import wrapped

    settings = study_settings(parsed)
    failed = []
    for found in findings(design(settings), settings, load_rates(), parsed.cores):
        print("\n".join(wrapped(f"{found.what:<10} {found.state:<6} {found.says}")))
        if found.state == FAILS:
            failed.append(found.what)
    if failed:
        raise UserError(f"doctor: the study is impossible here: {', '.join(failed)}; each line above says the way out")
