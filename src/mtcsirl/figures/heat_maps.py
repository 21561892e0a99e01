"""Tables 1 and 3 as heat maps: the paper's and ours side by side on one colour scale."""

import numpy as np
import pandas as pd
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.image import AxesImage

from mtcsirl.figures.style import (
    NOT_ASKED,
    TEXT_WIDTH,
    add_notes,
    new_figure,
    panel_title,
    quantity,
    scale_notes,
    styled,
)
from mtcsirl.results.published import Published, load_published
from mtcsirl.settings import Settings
from mtcsirl.tables.cells import MARK_TEXTS, MARKS
from mtcsirl.tables.cross_transfer import baseline_cell, transfer_cell

COLOURS = colormaps["cividis"]
LUMINANCE = (0.2126, 0.7152, 0.0722)
"""Weights of linear red, green and blue; black ink reads better than white above 0.18."""
SHORT = {"button-press-topdown-wall": "BP-topdown-wall"}
CAPTION = (
    "{quantity} of new agents divided by its target: the paper's Table {number} (left) and ours (right) on one colour "
    "scale. Rows: task whose reward was used, last row: plain SAC; columns: task of the new agent. Mean over n = {n} "
    "seeds; hatched: no seed there yet; star: fewer seeds than the study asks for; dagger: so many of its "
    "agents are below their gate."
)


def heat_map_matrices(
    cs_reward: str, rows: pd.DataFrame, settings: Settings, published: Published
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Paper's and our ratios [sources + 1, tasks] (last row: SAC), whether seeds are missing in ours, and how many of
    our agents are below their gate."""
    tasks = settings.multi_target.tasks
    cells = [[transfer_cell(rows, published, cs_reward, source, task) for task in tasks] for source in tasks]
    cells.append([baseline_cell(rows, published, cs_reward, task) for task in tasks])
    paper = np.array([[cell.paper.mean for cell in row] for row in cells])
    ours = np.array([[cell.ours.mean for cell in row] for row in cells])
    incomplete = np.array([[cell.ours.n < cell.expected for cell in row] for row in cells])
    below = np.array([[cell.marks.get("below", 0) for cell in row] for row in cells])
    return paper, ours, incomplete, below


@styled
def heat_map(cs_reward: str, rows: pd.DataFrame, settings: Settings, published: Published | None = None) -> Figure:
    """Draw the heat maps of Table 1 (action_norm) or Table 3 (velocity) from ``evaluation_rows``."""
    paper, ours, incomplete, below = heat_map_matrices(cs_reward, rows, settings, published or load_published())
    plain = np.full(paper.shape, "")
    counts = np.char.add(f"\n{MARKS['below']}", below.astype(str))
    marks = np.char.add(np.where(incomplete, "*", ""), np.where(below, counts, ""))
    names = [SHORT.get(task, task) for task in settings.multi_target.tasks]
    figure = new_figure(TEXT_WIDTH, 3.0)
    left, right = figure.subplots(1, 2, sharey=True)
    top = float(np.nanmax([np.nanmax(paper, initial=1.0), np.nanmax(ours, initial=1.0)]))
    image = None
    for index, (axes, values, own, title) in enumerate(((left, paper, plain, "paper"), (right, ours, marks, "ours"))):
        image = _draw(axes, values, names, top)
        _write(axes, values, own, top)
        panel_title(axes, index, title)
    assert image is not None
    figure.colorbar(image, ax=[left, right], shrink=0.8, label=f"{quantity(cs_reward)} / target")
    left.set_ylabel("reward learned on")
    notes = scale_notes(settings.scale)
    notes += ["* fewer seeds than the study asks for"] if incomplete.any() else []
    notes += [MARK_TEXTS["below"]] if below.any() else []
    notes += [] if cs_reward in settings.cs_rewards else [NOT_ASKED]
    add_notes(figure, notes)
    return figure


def heat_map_caption(cs_reward: str, settings: Settings) -> str:
    """The caption of the figure."""
    number = {"action_norm": "1", "velocity": "3"}.get(cs_reward, "-")
    return CAPTION.format(quantity=quantity(cs_reward).capitalize(), number=number, n=len(settings.seeds))


def _draw(axes: Axes, values: np.ndarray, names: list[str], top: float) -> AxesImage:
    axes.patch.set(facecolor="0.96", edgecolor="0.75", hatch="////", linewidth=0)  # shows where a cell is missing
    image = axes.imshow(np.ma.masked_invalid(values), cmap=COLOURS, vmin=0.0, vmax=top, aspect="auto")
    axes.set_xticks(range(len(names)), names, rotation=40, ha="right", rotation_mode="anchor")
    axes.set_yticks(range(len(names) + 1), [*names, "SAC"])
    axes.axhline(len(names) - 0.5, color="white", linewidth=2)
    axes.grid(False)
    axes.tick_params(length=0)
    return image


def _write(axes: Axes, values: np.ndarray, marks: np.ndarray, top: float) -> None:
    for (row, column), value in np.ndenumerate(values):
        if np.isfinite(value):
            ink = "white" if _luminance(value / top) < 0.18 else "black"
            weight = "bold" if row == column else "normal"
            text = f"{value:.2f}{marks[row, column]}"
            axes.text(column, row, text, ha="center", va="center", color=ink, fontsize=6.5, fontweight=weight)


def _luminance(part: float) -> float:
    """Relative luminance of the colour at ``part`` of the scale, in [0, 1]."""
    return float(np.dot(LUMINANCE, np.array(COLOURS(part)[:3]) ** 2.2))
