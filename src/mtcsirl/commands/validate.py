"""The verb that checks MT-CSIRL where the truth is known."""

import argparse
from pathlib import Path

from mtcsirl.commands.arguments import Verbs, add_output, add_verb, natural, new_folder
from mtcsirl.commands.drawing import write_figure


def register(verbs: Verbs) -> None:
    """Add the verb."""
    verb = add_verb(
        verbs,
        "validate",
        _validate,
        does="recover a known reward on a point mass, with controls",
        needs="nothing",
        writes="correlations.csv, agents.csv, curve.csv into --output; validation.pdf, .png into --figures",
    )
    add_output(verb, "results/validation")
    verb.add_argument(
        "--figures", type=new_folder, default=Path("paper_figs"), metavar="DIR", help="folder of the figure"
    )
    verb.add_argument("--processes", type=natural, default=1, help="seeds that run at the same time")


def _validate(parsed: argparse.Namespace) -> None:
    from mtcsirl.files.storage import write_csv
    from mtcsirl.validation.figure import caption, draw
    from mtcsirl.validation.study import ValidationSettings, validate

    findings = validate(ValidationSettings(), processes=parsed.processes)
    for name, frame in findings._asdict().items():
        write_csv(parsed.output / f"{name}.csv", frame)
    figure, text = draw(findings), caption(findings)
    write_figure(parsed.figures / "validation", figure, text)
    print(text)
