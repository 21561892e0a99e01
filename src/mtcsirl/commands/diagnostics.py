"""The verb that draws what one IRL run logged; `mtcsirl diagnostics` lists all of a study."""

import argparse

from mtcsirl.commands.arguments import Verbs, add_study_settings, add_verb, new_file, path, study_settings
from mtcsirl.commands.drawing import write_figure


def register(verbs: Verbs) -> None:
    """Add the verb."""
    drawing = add_verb(
        verbs,
        "draw-diagnostics",
        _draw,
        does="draw what an IRL run logged: discriminators, log pi, temperature, gradients, generators",
        needs="the folder of an IRL run",
        writes="the file --output as PNG and PDF",
    )
    drawing.add_argument("--run", required=True, type=path, metavar="DIR", dest="folder", help="folder of the IRL run")
    drawing.add_argument("--output", required=True, type=new_file, metavar="FILE", help="for example s0.png")
    add_study_settings(drawing)


def _draw(parsed: argparse.Namespace) -> None:
    from mtcsirl.figures.diagnostics import caption, draw
    from mtcsirl.figures.style import look, quantity
    from mtcsirl.files import storage
    from mtcsirl.names import CURVE_COLUMNS, DIAGNOSTIC_COLUMNS

    settings = study_settings(parsed)
    about = storage.read_json(parsed.folder / "reward.json")
    curve = storage.read_csv(parsed.folder / "curve.csv", CURVE_COLUMNS)
    diagnostics = storage.read_csv(parsed.folder / "diagnostics.csv", DIAGNOSTIC_COLUMNS)
    title = f"{look(about['method']).label}, {quantity(about['cs_reward'])}, seed {about['about']['seed']}"
    text = caption(title)
    write_figure(parsed.output, draw(curve, diagnostics, about["cs_reward"], title, settings.scale), text)
    print(text)
