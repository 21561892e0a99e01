"""Figure 9: the Sawyer with its end effector, on which the velocity is measured, marked with an arrow."""

from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from mtcsirl.figures.data import FigureData
from mtcsirl.figures.style import TEXT_WIDTH, new_figure, scale_notes, styled
from mtcsirl.worlds.rendering import Image, SceneRenderer, camera_pose

TITLE = "Sawyer robot with its end effector"
_CAMERA = "corner"
_ARROW = "#FFD000"
_SIZE = (960, 960)
_CROP = (slice(0, 800), slice(60, 960))


def draw(data: FigureData) -> Figure:
    """Render the scene of reach, look up the end effector as the observation has it and point at it.

    Raises UserError without OSMesa.
    """
    picture, tip = end_effector_scene()
    return compose(picture[_CROP], tip - np.array([_CROP[1].start, _CROP[0].start]), scale_notes(data.settings.scale))


def end_effector_scene() -> tuple[Image, NDArray[np.float64]]:
    """The picture of the robot and the pixel (column, row) of the hand, observation entries 0:3."""
    from mtcsirl.worlds.environments import make_environment

    environment = make_environment("reach", 0, observation="raw")
    observation, _ = environment.reset()
    simulator = environment.simulator
    with SceneRenderer(simulator.model, width=_SIZE[0], height=_SIZE[1]) as renderer:
        picture = renderer.render(simulator.data, _CAMERA)
    pose = camera_pose(simulator.model, simulator.data, _CAMERA)
    environment.close()
    return picture, pose.project(observation[:3].astype(np.float64), *_SIZE)


@styled
def compose(picture: Image, tip: NDArray[np.float64], notes: Sequence[str] = ()) -> Figure:
    """The picture with an arrow whose tip is at the pixel ``tip`` (column, row)."""
    height, width = picture.shape[:2]
    figure = new_figure(0.45 * TEXT_WIDTH, 0.45 * TEXT_WIDTH * height / width)
    figure.set_layout_engine("none")
    axes = figure.add_axes((0, 0, 1, 1))
    axes.imshow(picture, interpolation="antialiased")
    axes.set_axis_off()
    axes.annotate(
        r"end effector $\ell(s)$",
        (float(tip[0]), float(tip[1])),
        xytext=(0.04 * width, tip[1] - 0.25 * height),
        arrowprops={"arrowstyle": "-|>", "color": _ARROW, "linewidth": 1.8, "shrinkA": 1, "shrinkB": 0},
        bbox={"facecolor": "white", "edgecolor": _ARROW, "boxstyle": "round,pad=0.25"},
        fontsize=7,
    )
    axes.text(0.5, 0.02, "\n".join(notes), transform=axes.transAxes, ha="center", fontsize=6.5, color="white")
    return figure


def caption(data: FigureData) -> str:
    """What the figure shows."""
    return (
        "The end effector, whose speed |l(s') - l(s)| / 0.0125 s is the velocity, is marked with an "
        "arrow. The arrow's tip is the 3-D position in entries 0 to 2 of the observation, projected through the camera."
    )
