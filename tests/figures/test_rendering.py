"""Rendered figures: upright, not mirrored, and pointing where they say."""

import os
import subprocess
import sys

import numpy as np
import pytest

from mtcsirl.errors import UserError
from mtcsirl.figures import figure_8, figure_9
from mtcsirl.figures.data import FigureData
from mtcsirl.settings import Settings
from mtcsirl.worlds.environments import make_environment
from mtcsirl.worlds.rendering import CameraPose, SceneRenderer, camera_pose
from tests import hidden
from tests.conftest import needs_rendering

SIZE = (320, 240)


@pytest.fixture(scope="module")
def environment():
    made = make_environment("reach-wall", 0, observation="raw")
    made.reset()
    yield made
    made.close()


def test_projection_worked_out_by_hand():
    pose = CameraPose(np.zeros(3), np.eye(3), 90.0)  # looks along -z with y up; tan(45 degrees) = 1
    points = np.array([[0, 0, -2.0], [1, 1, -2.0], [-2, 0, -2.0], [0, 0, 1.0]])
    expected = [[100, 50], [125, 25], [50, 50], [np.nan, np.nan]]
    np.testing.assert_allclose(pose.project(points, 200, 100), expected)


@needs_rendering
@pytest.mark.parametrize("camera", ["corner2", "corner", "topview"])
def test_goal_sphere_is_seen_where_it_projects_to(environment, camera):
    simulator = environment.simulator
    with SceneRenderer(simulator.model, width=SIZE[0], height=SIZE[1]) as renderer:
        picture = renderer.render(simulator.data, camera).astype(int)
    goal = camera_pose(simulator.model, simulator.data, camera).project(np.array(simulator._target_pos), *SIZE)
    rows, columns = np.nonzero((picture[..., 0] > 150) & (picture[..., 1:] < 60).all(axis=-1))
    near = np.hypot(columns - goal[0], rows - goal[1]) < 12
    assert near.sum() >= 6
    assert np.hypot(columns[near].mean() - goal[0], rows[near].mean() - goal[1]) < 1.5


def test_unknown_camera_names_the_allowed_ones(environment):
    with pytest.raises(UserError, match=r"unknown camera 'ceiling'; allowed: .*corner2"):
        camera_pose(environment.simulator.model, environment.simulator.data, "ceiling")


def _drawn(before: str = "", **variables: str) -> str:
    """What a process prints that draws an empty scene under these environment variables."""
    program = (
        f"{before}\n"
        "from mtcsirl.errors import UserError\n"
        "try:\n"
        "    from mtcsirl.worlds.variables import backend\n    import os\n    backend(os.environ)\n"
        "    import mujoco\n    from mtcsirl.worlds.rendering import SceneRenderer\n"
        "    SceneRenderer(mujoco.MjModel.from_xml_string('<mujoco/>'), width=8, height=8).close()\n"
        "    print('drawn')\n"
        "except UserError as error:\n    print(error)\n"
    )
    own = {
        name: value for name, value in os.environ.items() if name not in ("MUJOCO_GL", "PYOPENGL_PLATFORM", "DISPLAY")
    }
    done = subprocess.run(
        [sys.executable, "-c", program], env=own | variables, capture_output=True, text=True, check=True
    )
    assert done.stdout.count("\n") == 1, done.stdout
    return done.stdout


def test_machine_without_osmesa_is_told_the_package():
    assert "apt-get install libosmesa6" in _drawn(hidden.OSMESA)


@pytest.mark.parametrize(
    ("variables", "says"),
    [
        ({"PYOPENGL_PLATFORM": "egl"}, "PYOPENGL_PLATFORM=egl: pictures are drawn by osmesa; unset it"),
        ({"MUJOCO_GL": "egl", "PYOPENGL_PLATFORM": "osmesa"}, "PYOPENGL_PLATFORM=osmesa: MUJOCO_GL=egl draws by egl;"),
        ({"MUJOCO_GL": "nonsense"}, "MUJOCO_GL=nonsense: MuJoCo knows no such back end; unset it"),
        ({"MUJOCO_GL": "glfw"}, "MUJOCO_GL=glfw: draws by glfw and needs a display"),
        pytest.param({"MUJOCO_GL": "off"}, "drawn", marks=needs_rendering),
        pytest.param({"MUJOCO_GL": "osmesa", "PYOPENGL_PLATFORM": "osmesa"}, "drawn", marks=needs_rendering),
    ],
    ids=str,
)
def test_a_variable_that_keeps_pictures_from_being_drawn_is_named(variables, says):
    assert says in _drawn(**variables)


@needs_rendering
def test_sawyer_arrow_ends_between_the_fingers():
    picture, tip = figure_9.end_effector_scene()
    figure = figure_9.compose(picture, tip)
    (arrow,) = figure.axes[0].texts[:1]
    assert arrow.xy == pytest.approx(tip)
    column, row = np.round(tip).astype(int)
    around = picture[row - 60 : row + 60, column - 60 : column + 60].astype(int)
    cyan = (around[..., 0] < 90) & (around[..., 1] > 180) & (around[..., 2] > 180)
    white = (around > 225).all(axis=-1)
    assert min(cyan.sum(), white.sum()) > 200, "the left finger is cyan, the right one white"


def test_setups_are_the_studys():
    single, targets, tasks = figure_8.setups(Settings())
    assert single.train == single.test == (("reach-wall", 0),)
    assert {task for task, _ in targets.train} == {"reach-wall"}
    assert 0 not in {target for _, target in targets.train}
    assert not {task for task, _ in tasks.train} & {task for task, _ in tasks.test}


@needs_rendering
def test_overview_shows_every_scene_once_where_it_belongs():
    settings = Settings(scale="smoke")
    shot = figure_8.shoot(("drawer-close", 0), 0)
    height, width = shot.picture.shape[:2]
    assert 0 < shot.goal[0] < width
    assert 0 < shot.goal[1] < height
    green = shot.picture[..., 1].astype(int) - shot.picture[..., [0, 2]].max(axis=-1)
    assert (green > 30).sum() > 500, "the drawer is green"
    setups = figure_8.setups(settings)
    scenes = [scene for setup in setups for scene in (*setup.train, *setup.test)]
    figure = figure_8.compose(settings, dict.fromkeys(scenes, shot))
    assert [axes.get_xlabel().replace("\n", "") for axes in figure.axes] == [task for task, _ in scenes]
    assert [axes.texts[0].get_text() for axes in figure.axes] == [f"target {target}" for _, target in scenes]
    assert "smoke scale: numbers mean nothing" in [text.get_text() for text in figure.texts]
    assert "reach-wall" in figure_8.caption(FigureData(settings=settings))
