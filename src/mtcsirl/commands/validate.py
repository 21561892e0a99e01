"""The verb that checks MT-CSIRL where the truth is known."""

import argparse

from mtcsirl.commands.arguments import Verbs, add_output, add_verb, new_folder, path, positive
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
    verb.add_argument("--figures", type=new_folder, default="paper_figs", metavar="DIR", help="folder of the figure")
    verb.add_argument("--results", type=path, metavar="DIR", help="results folder where to note what was made")
    verb.add_argument("--processes", type=positive, default=1, help="seeds that run at the same time")


def _validate(parsed: argparse.Namespace) -> None:
    from mtcsirl.files.storage import write_csv
    from mtcsirl.settings.loading import configured
    from mtcsirl.study.folders import check_without_run
    from mtcsirl.validation.figure import caption, draw
    from mtcsirl.validation.recovery import ValidationSettings, recover

    for folder in (parsed.output, parsed.figures):
        check_without_run(folder)
    settings = None if parsed.results is None else configured({"results": str(parsed.results)})
    findings = recover(ValidationSettings(), processes=parsed.processes)
    for name, frame in findings._asdict().items():
        write_csv(parsed.output / f"{name}.csv", frame)
    figure, text = draw(findings), caption(findings)
    write_figure(parsed.figures / "validation", figure, text)
    if settings is not None:
        from mtcsirl.study.artefacts import sign_artefact

        drawn = [parsed.figures / f"validation.{ending}" for ending in ("pdf", "png")]
        made = [parsed.output / f"{name}.csv" for name in findings._asdict()] + drawn
        sign_artefact("validation", settings, made)
    print(text)
