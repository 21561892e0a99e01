"""The verb that trains the agents of a study in lockstep."""

import argparse
from pathlib import Path

from mtcsirl.commands.arguments import (
    Verbs,
    add_artefact,
    add_device,
    add_study_settings,
    add_verb,
    add_workers,
    positive,
    study_settings,
)
from mtcsirl.files.storage import check_writable
from mtcsirl.settings.machine import check_study

AGENT_STAGES = ("train_sac", "train_expert", "transfer")


def register(verbs: Verbs) -> None:
    """Add the verb."""
    verb = add_verb(
        verbs,
        "train-together",
        _run,
        does="train the missing agents of a study or of one artefact in lockstep, many in one process",
        needs="for transfer agents their learned rewards; agents whose reward is missing are left alone",
        writes="what train-sac, train-expert and transfer write, into the study's results folder",
    )
    add_artefact(verb)
    verb.add_argument("--stages", nargs="+", choices=AGENT_STAGES, default=AGENT_STAGES, help="default: all three")
    verb.add_argument("--most", type=positive, default=16, metavar="N", help="agents in one batch; default 16")
    add_workers(verb)
    add_study_settings(verb)
    add_device(verb)


def _run(parsed: argparse.Namespace) -> None:
    from mtcsirl.stages.together import train_together
    from mtcsirl.study.design import design

    settings = study_settings(parsed)
    check_study(settings)
    check_writable(settings.results, folder=True)
    runs = [run for run in design(settings, parsed.target).agents if run.stage in parsed.stages]
    trained = train_together(runs, settings, Path(settings.results), most=parsed.most, workers=parsed.workers)
    print(f"{trained} agents trained")
