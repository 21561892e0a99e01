"""The look of all figures: one colour, line and marker per method, the notes, and the way to bytes."""

import logging
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from functools import wraps
from importlib import resources
from io import BytesIO
from typing import Literal, NamedTuple, ParamSpec

import matplotlib
import PIL.Image
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from mtcsirl.names import AGENTS, QUANTITIES, Quantity, agent_label
from mtcsirl.results.notes import scale_notes as scale_notes  # every drawing says it
from mtcsirl.rewards.ground_truth import COMMON_SENSE_REWARDS

TEXT_WIDTH = 5.5
"""Width of the paper's text in inches; figures are drawn at the size at which they are printed."""
NO_RUNS, NOT_ASKED = "no runs yet", "not part of this study"
"""Why a panel is empty."""
TARGET_COLOUR = "#C00000"
NOTE_COLOUR = "#8C2D04"
INK = "#222222"

Arguments = ParamSpec("Arguments")


class Look(NamedTuple):
    """How one method is drawn everywhere: readable in colour, in greyscale and for the colour-blind."""

    label: str
    colour: str
    linestyle: str | tuple[int, tuple[float, ...]]
    marker: str


COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#222222", "#8C6D31")
"""For series that are no methods, in their order: Okabe-Ito and two more."""

LOOKS: dict[str, Look] = {
    "expert": Look(AGENTS["expert"], "#009E73", (0, (5, 1.5)), "s"),
    "sac": Look(AGENTS["sac"], "#E69F00", (0, (1, 1.2)), "^"),
    "irl_agent": Look(AGENTS["irl_agent"], "#56B4E9", (0, (4, 1, 1, 1)), "D"),
    "mt_airl": Look(AGENTS["mt_airl"], "#CC79A7", (0, (3, 1)), "v"),
    "mt_vairl": Look(AGENTS["mt_vairl"], "#8C6D31", (0, (3, 1, 1, 1)), "<"),
    "mt_vairl_gp": Look(AGENTS["mt_vairl_gp"], "#7F7F7F", (0, (3, 1, 1, 1, 1, 1)), ">"),
    "mt_csirl": Look(AGENTS["mt_csirl"], "#0072B2", "-", "o"),
    "mt_csirl_lt": Look(AGENTS["mt_csirl_lt"], "#222222", (0, (8, 2)), "P"),
}
"""Okabe-Ito colours; a method that is not listed is drawn by :func:`look` in grey under its own name."""


def look(method: str) -> Look:
    """The look of ``method``; one that the suite does not ship gets grey, so it still shows."""
    return LOOKS.get(method, Look(agent_label(method), "#555555", (0, (2, 1)), "X"))


def quantity(metric: str) -> str:
    """Name of a metric in words, as in ``velocity``."""
    return _quantity(metric).label


def quantity_label(metric: str) -> str:
    """Axis label of a metric with its unit, as in ``velocity (m/s)``."""
    name, unit, _ = _quantity(metric)
    return f"{name} ({unit})" if unit else name


def _quantity(metric: str) -> Quantity:
    """A metric of the suite; a cs-reward of one's own with the unit of its registry entry; else its bare name."""
    if metric in QUANTITIES:
        return QUANTITIES[metric]
    own = COMMON_SENSE_REWARDS.get(metric)
    return Quantity(metric.replace("_", " "), own.unit if own else "")


def target_of(cs_reward: str) -> float:
    """The value that the ground-truth cs-reward aims at, in its unit."""
    return COMMON_SENSE_REWARDS[cs_reward].target


@contextmanager
def paper_style() -> Iterator[None]:
    """Draw with the suite's style; no matplotlibrc of the reader has a say."""
    sheet = resources.files("mtcsirl.figures").joinpath("mtcsirl.mplstyle")
    with resources.as_file(sheet) as path:
        parameters = matplotlib.rc_params_from_file(path, use_default_template=True)
    with matplotlib.rc_context(parameters):
        yield


def styled(draw: Callable[Arguments, Figure]) -> Callable[Arguments, Figure]:
    """Let a drawing function run inside :func:`paper_style`."""

    @wraps(draw)
    def inside(*args: Arguments.args, **kwargs: Arguments.kwargs) -> Figure:
        with paper_style():
            return draw(*args, **kwargs)

    return inside


def new_figure(width: float, height: float) -> Figure:
    """A figure of ``width`` x ``height`` inches that no global state knows of."""
    figure = Figure(figsize=(width, height))
    FigureCanvasAgg(figure)
    return figure


def figure_bytes(figure: Figure, kind: Literal["png", "pdf"], caption: str = "") -> bytes:
    """The figure as a PNG or PDF file that carries its caption; no date, so equal figures give equal bytes."""
    stamp = {
        "pdf": {"CreationDate": None, "Producer": None, "Subject": caption},
        "png": {"Software": None, "Description": caption},
    }[kind]
    buffer = BytesIO()
    logging.getLogger("fontTools").setLevel(logging.ERROR)  # it remarks on the font's own time stamp
    with paper_style():
        figure.savefig(buffer, format=kind, metadata=stamp)
    return buffer.getvalue()


def caption_of(png: bytes) -> str:
    """The caption that :func:`figure_bytes` put into a PNG file; empty if there is none."""
    with PIL.Image.open(BytesIO(png)) as image:
        return str(image.info.get("Description", ""))


def add_notes(figure: Figure, notes: Sequence[str]) -> None:
    """Write notes under the panels, which keep their size: what is missing, the scale."""
    if notes:
        figure.set_figheight(figure.get_figheight() + 0.14 * len(notes))
        figure.supxlabel("\n".join(notes), fontsize=6.5, color=NOTE_COLOUR)


def step_axis(axes: Axes) -> None:
    """Label the horizontal axis as environment steps, in thousands."""
    axes.set_xlabel("environment steps")
    axes.xaxis.set_major_formatter(lambda step, _: f"{step / 1000:g}k" if step else "0")


def share_axis(axes: Axes, shortest: int, longest: int) -> None:
    """Label the horizontal axis as percent of each agent's own steps, of which there are so many."""
    axes.set_xlabel(f"% of an agent's {shortest / 1000:g}k to {longest / 1000:g}k steps")


def empty_panel(axes: Axes, reason: str) -> None:
    """Say in an empty panel why it is empty."""
    axes.set_xticks([])
    axes.text(0.5, 0.5, reason, transform=axes.transAxes, ha="center", va="center", color=NOTE_COLOUR)


def letter(index: int) -> str:
    """How the paper counts panels: a, b, c."""
    return chr(ord("a") + index)


def panel_title(axes: Axes, index: int, text: str) -> None:
    """Title of a panel as the paper counts them: (a), (b), (c)."""
    axes.set_title(f"({letter(index)}) {text}", loc="left")
