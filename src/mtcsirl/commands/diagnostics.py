"""The verb that draws what one IRL run logged; `mtcsirl diagnostics` lists all of a study."""

import argparse
from pathlib import Path

from mtcsirl.commands.arguments import Verbs, add_study_settings, add_verb, new_file, path, study_settings
from mtcsirl.commands.drawing import write_figure
from mtcsirl.errors import UserError

ENDINGS = (".png", ".pdf", "")


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
    if parsed.output.suffix not in ENDINGS:
        raise UserError(f"--output {parsed.output}: a figure is written as .png and .pdf; name one of them")
    from mtcsirl.figures.diagnostics import caption, draw
    from mtcsirl.figures.style import look, quantity
    from mtcsirl.files import storage
    from mtcsirl.names import CURVE_COLUMNS, DIAGNOSTIC_COLUMNS

    settings = study_settings(parsed)
    method, cs_reward, run_seed = _about(parsed.folder / "reward.json")
    curve = storage.read_csv(parsed.folder / "curve.csv", CURVE_COLUMNS)
    diagnostics = storage.read_csv(parsed.folder / "diagnostics.csv", DIAGNOSTIC_COLUMNS)
    for name, frame in (("curve.csv", curve), ("diagnostics.csv", diagnostics)):
        if frame.empty:
            raise UserError(f"{parsed.folder / name}: holds no row; name the folder of an IRL run that has ended")
    title = f"{look(method).label}, {quantity(cs_reward)}, seed {run_seed}"
    text = caption(title)
    write_figure(parsed.output, draw(curve, diagnostics, cs_reward, title, settings.scale), text)
    print(text)


def _about(file: Path) -> tuple[str, str, int]:
    """Method, cs-reward and seed of the reward that ``file`` describes.

    Raises:
        UserError: the file does not say them, or the cs-reward is one of an extension that is not loaded.
    """
    from mtcsirl.files.storage import read_json
    from mtcsirl.rewards.ground_truth import COMMON_SENSE_REWARDS

    said = read_json(file)
    try:
        method, cs_reward, run_seed = str(said["method"]), str(said["cs_reward"]), int(said["about"]["seed"])
    except (KeyError, TypeError, ValueError) as error:
        raise UserError(f"{file}: lacks method, cs_reward or about.seed; name the folder of an IRL run") from error
    if cs_reward not in COMMON_SENSE_REWARDS:
        known = ", ".join(COMMON_SENSE_REWARDS)
        raise UserError(f"{file}: cs_reward {cs_reward!r} is none of {known}; name its file by --set extensions=[FILE]")
    return method, cs_reward, run_seed
