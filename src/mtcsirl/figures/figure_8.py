"""Figure 8: the train and test tasks of the three experiments, rendered."""

import textwrap
from collections.abc import Mapping
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from mtcsirl.figures.data import FigureData
from mtcsirl.figures.style import INK, NOTE_COLOUR, TEXT_WIDTH, new_figure, scale_notes, styled
from mtcsirl.names import EVALUATION_TARGET
from mtcsirl.settings import Settings
from mtcsirl.worlds.rendering import Image, camera_pose

TITLE = "Train and test tasks of the three experiments"
Scene = tuple[str, int]
"""Task and target."""
_COLUMNS = 3
_CROP = (slice(125, 405), slice(70, 410))
"""The part of the 480 x 480 picture that holds arm and table."""
_PICTURE = (0.86, 0.86 * 280 / 340)
"""Width and height of a picture in inches."""
_ROW, _HEAD, _GAP = 1.02, 0.42, 0.04
_RING = "#FFD000"


class Shot(NamedTuple):
    """A picture and the pixel (column, row) of the goal as the observation has it."""

    picture: Image
    goal: NDArray[np.float64]


@dataclass(frozen=True)
class Setup:
    """One experiment: what its reward is learned from and where it is tried."""

    title: str
    train: tuple[Scene, ...]
    test: tuple[Scene, ...]

    @property
    def rows(self) -> int:
        """Rows of pictures."""
        return -(-max(len(self.train), len(self.test)) // _COLUMNS)


def setups(settings: Settings) -> tuple[Setup, Setup, Setup]:
    """The three experiments of ``settings``; several sources (sections 5.1, 5.2) are shown by their first."""
    single = settings.single_target.tasks[0]
    tasks = settings.multi_target.tasks
    several = settings.multi_task
    return (
        Setup("Single target (section 5.1)", ((single, EVALUATION_TARGET),), ((single, EVALUATION_TARGET),)),
        Setup(
            "Multi target (section 5.2)",
            tuple((tasks[0], target) for target in settings.multi_target.train_targets),
            tuple((task, EVALUATION_TARGET) for task in tasks),
        ),
        Setup(
            "Multi task (sections 5.3, 5.4)",
            tuple((task, several.train_targets[0]) for task in several.train_tasks),
            tuple((task, EVALUATION_TARGET) for task in several.unseen_tasks),
        ),
    )


def draw(data: FigureData) -> Figure:
    """Render every scene once and lay them out; UserError without OSMesa."""
    scenes = {scene for setup in setups(data.settings) for scene in (*setup.train, *setup.test)}
    shots = {scene: shoot(scene, data.settings.environment.target_seed) for scene in sorted(scenes)}
    return compose(data.settings, shots)


def shoot(scene: Scene, target_seed: int) -> Shot:
    """Render the first state of a task and target."""
    from mtcsirl.worlds.environments import make_environment

    environment = make_environment(*scene, observation="raw", target_seed=target_seed, render=True)
    observation, _ = environment.reset()
    picture = environment.render()
    pose = camera_pose(environment.simulator.model, environment.simulator.data)
    environment.close()
    goal = pose.project(observation[36:39].astype(np.float64), picture.shape[1], picture.shape[0])
    return Shot(picture[_CROP], goal - np.array([_CROP[1].start, _CROP[0].start]))


@styled
def compose(settings: Settings, shots: Mapping[Scene, Shot]) -> Figure:
    """The layout: one block per experiment, train tasks on the left, test tasks on the right."""
    blocks = setups(settings)
    notes = scale_notes(settings.scale)
    height = sum(_HEAD + _ROW * block.rows for block in blocks) + 0.15 * len(notes)
    figure = new_figure(TEXT_WIDTH, height)
    figure.set_layout_engine("none")
    top = height
    for block in blocks:
        _draw_block(figure, block, shots, top)
        top -= _HEAD + _ROW * block.rows
    for note in notes:
        figure.text(0.5, 0.05 / height, note, ha="center", fontsize=6.5, color=NOTE_COLOUR)
    return figure


def caption(data: FigureData) -> str:
    """What the figure shows."""
    several = data.settings.multi_task
    return (
        "Single target: the reward is learned and tried on the same "
        f"task and target; it is repeated for {', '.join(data.settings.single_target.tasks)}. Multi target: learned "
        f"from {_targets(data.settings.multi_target.train_targets)} of one task (here "
        f"{data.settings.multi_target.tasks[0]}; repeated for each task), tried on a new target of every task. "
        f"Multi task: learned from {len(several.train_tasks)} tasks with {_targets(several.train_targets)} "
        "each (one is shown), tried on unseen tasks. "
        "Target n is Meta-World's n-th variation of the task; the ring is its goal as the observation has it. "
        "Camera: corner2, turned upright."
    )


def _targets(targets: tuple[int, ...]) -> str:
    return "1 target" if len(targets) == 1 else f"{len(targets)} targets"


def _draw_block(figure: Figure, block: Setup, shots: Mapping[Scene, Shot], top: float) -> None:
    """One experiment, its upper edge ``top`` inches above the figure's lower edge."""
    width, height = figure.get_size_inches()
    figure.text(0.01, (top - 0.14) / height, block.title, fontsize=7.5, fontweight="bold", color=INK)
    for name, scenes, left in (("train", block.train, 0.04), ("test", block.test, width / 2 + 0.06)):
        figure.text((left + 0.02) / width, (top - 0.32) / height, name, fontsize=7, color=INK)
        for index, scene in enumerate(scenes):
            row, column = divmod(index, _COLUMNS)
            x = left + column * (_PICTURE[0] + _GAP)
            y = top - _HEAD - row * _ROW - _PICTURE[1] + 0.04
            axes = figure.add_axes((x / width, y / height, _PICTURE[0] / width, _PICTURE[1] / height))
            _show(axes, shots[scene], scene)


def _show(axes: Axes, shot: Shot, scene: Scene) -> None:
    task, target = scene
    axes.imshow(shot.picture, interpolation="antialiased", aspect="auto")
    axes.plot(*shot.goal, marker="o", markersize=6, markerfacecolor="none", markeredgecolor=_RING, markeredgewidth=0.9)
    axes.set_xlim(0, shot.picture.shape[1])
    axes.set_ylim(shot.picture.shape[0], 0)
    axes.set_xticks([])
    axes.set_yticks([])
    axes.grid(False)
    for spine in axes.spines.values():
        spine.set(visible=True, color="0.6", linewidth=0.5)
    axes.text(
        0.965, 0.93, f"target {target}", transform=axes.transAxes, color="white", fontsize=5.5, ha="right", va="top",
        bbox={"facecolor": "#333333", "edgecolor": "none", "alpha": 0.75, "pad": 1.2},
    )  # fmt: skip
    axes.set_xlabel("\n".join(textwrap.wrap(task, 18)), fontsize=6, labelpad=1.5)
