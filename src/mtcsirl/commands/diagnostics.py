"""The verbs that show what IRL runs logged: one run as a figure, all of a study as a table."""

import argparse
from pathlib import Path

from mtcsirl.commands.arguments import Verbs, add_study_settings, add_verb, study_settings
from mtcsirl.commands.drawing import write_figure
from mtcsirl.design import design


def register(verbs: Verbs) -> None:
    """Add the verbs."""
    drawing = add_verb(
        verbs,
        "draw-diagnostics",
        _draw,
        does="draw what an IRL run logged: discriminators, log pi, temperature, gradients, generators",
        needs="the folder of an IRL run",
        writes="the file --output as PNG and PDF",
    )
    drawing.add_argument("--run", required=True, type=Path, metavar="DIR", dest="folder", help="folder of the IRL run")
    drawing.add_argument("--output", required=True, type=Path, metavar="FILE", help="for example s0.png")
    add_study_settings(drawing)

    table = add_verb(
        verbs,
        "diagnostics",
        _table,
        does="say which discriminators of a study were saturated, asleep or at work",
        needs="the study's IRL runs in its results folder; with --partial those that are there",
        writes="diagnostics.csv, diagnostics.md into --output",
    )
    table.add_argument("--partial", action="store_true", help="read what is there")
    table.add_argument("--output", type=Path, metavar="DIR", help="default: where the DAG puts it")
    add_study_settings(table)


def _draw(parsed: argparse.Namespace) -> None:
    from mtcsirl import storage
    from mtcsirl.figures.diagnostics import CURVE_COLUMNS, DIAGNOSTIC_COLUMNS, caption, draw
    from mtcsirl.figures.style import look, quantity

    settings = study_settings(parsed)
    about = storage.read_json(parsed.folder / "reward.json")
    curve = storage.read_csv(parsed.folder / "curve.csv", CURVE_COLUMNS)
    diagnostics = storage.read_csv(parsed.folder / "diagnostics.csv", DIAGNOSTIC_COLUMNS)
    title = f"{look(about['method']).label}, {quantity(about['cs_reward'])}, seed {about['about']['seed']}"
    text = caption(title)
    write_figure(parsed.output, draw(curve, diagnostics, about["cs_reward"], title, settings.scale), text)
    print(text)


def _table(parsed: argparse.Namespace) -> None:
    from mtcsirl.analysis.diagnosis import diagnoses_markdown, read_diagnoses
    from mtcsirl.figures.style import scale_notes
    from mtcsirl.storage import write_csv, write_text

    settings = study_settings(parsed)
    results = Path(settings.results)
    runs = design(settings).irl_runs
    if parsed.partial:
        runs = tuple(run for run in runs if (results / run.folder / "gate.json").is_file())
    rows = read_diagnoses(runs, results)
    text = diagnoses_markdown(rows, scale_notes(settings.scale))
    folder = parsed.output or results / "diagnostics"
    write_csv(folder / "diagnostics.csv", rows)
    write_text(folder / "diagnostics.md", text)
    print(text)
