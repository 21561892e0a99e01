"""Pictures of a Meta-World scene without a screen, and where a 3-D point lands in them.

Off-screen rendering goes through OSMesa (Debian: ``libosmesa6``) unless ``MUJOCO_GL`` names another back end.
"""

import os
from typing import Any, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from mtcsirl.errors import UserError
from mtcsirl.worlds.variables import backend, check_platform

Image = NDArray[np.uint8]
CAMERA = "corner2"
MISSING_OSMESA = (
    "rendering without a screen needs OSMesa, which is not installed: "
    "install Debian's package libosmesa6 (apt-get install libosmesa6) or set MUJOCO_GL=egl on a machine with a GPU"
)


class CameraPose(NamedTuple):
    """A pinhole camera.

    ``position`` [3] in metres, ``axes`` [3, 3] with the columns right, up and backward, ``fovy`` in degrees.
    """

    position: NDArray[np.float64]
    axes: NDArray[np.float64]
    fovy: float

    def project(self, points: NDArray[np.float64], width: int, height: int) -> NDArray[np.float64]:
        """Pixel coordinates [..., 2] (column, row) of ``points`` [..., 3] in a picture of width x height.

        With p = axes^T (x - position): column = w/2 + s p_right / depth, row = h/2 - s p_up / depth, where
        depth = -p_backward and s = h / (2 tan(fovy/2)). A point behind the camera gives NaN.
        """
        right, up, backward = np.moveaxis((points - self.position) @ self.axes, -1, 0)
        depth = np.where(backward < 0, -backward, np.nan)
        scale = height / (2 * np.tan(np.radians(self.fovy) / 2))
        return np.stack([width / 2 + scale * right / depth, height / 2 - scale * up / depth], axis=-1)


def camera_pose(model: Any, data: Any, camera: str = CAMERA) -> CameraPose:
    """Pose of a camera of the model, turned upright where the model has it upside down (as ``corner2``)."""
    index = _camera_index(model, camera)
    axes = np.array(data.cam_xmat[index], dtype=np.float64).reshape(3, 3)
    if _upside_down(axes):
        axes[:, :2] *= -1
    return CameraPose(np.array(data.cam_xpos[index], dtype=np.float64), axes, float(model.cam_fovy[index]))


class SceneRenderer:
    """Renders one MuJoCo model to pictures [height, width, 3]; a context manager that frees its OpenGL context.

    ``fast`` leaves out shadows, reflections and the smoothing of edges: an eighth of the time, for videos.
    Raises UserError when the machine cannot render without a screen.
    """

    def __init__(self, model: Any, *, width: int, height: int, fast: bool = False) -> None:
        drawn_by = backend(os.environ)
        import mujoco

        self._model, self._mujoco = model, mujoco
        self._gl = _context(drawn_by, width, height)
        self._gl.make_current()
        model.vis.global_.offwidth = max(width, model.vis.global_.offwidth)
        model.vis.global_.offheight = max(height, model.vis.global_.offheight)
        if fast:
            model.vis.quality.offsamples = 0
        self._scene = mujoco.MjvScene(model, maxgeom=10_000)
        for flag in (mujoco.mjtRndFlag.mjRND_SHADOW, mujoco.mjtRndFlag.mjRND_REFLECTION):
            self._scene.flags[flag] = not fast
        try:
            self._context = mujoco.MjrContext(model, mujoco.mjtFontScale.mjFONTSCALE_150.value)
        except mujoco.FatalError as error:
            raise UserError(_no_context(drawn_by, "it gave no OpenGL context")) from error
        mujoco.mjr_setBuffer(mujoco.mjtFramebuffer.mjFB_OFFSCREEN.value, self._context)
        self._viewport = mujoco.MjrRect(0, 0, width, height)

    def render(self, data: Any, camera: str = CAMERA) -> Image:
        """The scene seen by a camera of the model, upright."""
        index = _camera_index(self._model, camera)
        view = self._mujoco.MjvCamera()
        view.type, view.fixedcamid = self._mujoco.mjtCamera.mjCAMERA_FIXED, index
        self._gl.make_current()
        self._mujoco.mjv_updateScene(
            self._model, data, self._mujoco.MjvOption(), None, view, self._mujoco.mjtCatBit.mjCAT_ALL, self._scene
        )
        picture = np.empty((self._viewport.height, self._viewport.width, 3), dtype=np.uint8)
        self._mujoco.mjr_render(self._viewport, self._scene, self._context)
        self._mujoco.mjr_readPixels(picture, None, self._viewport, self._context)
        picture = picture[::-1]  # OpenGL's first row is the bottom one
        if _upside_down(np.array(data.cam_xmat[index]).reshape(3, 3)):
            picture = picture[::-1, ::-1]  # the camera is rolled by half a turn: turn back, do not mirror
        return np.ascontiguousarray(picture)

    def close(self) -> None:
        """Free the OpenGL context."""
        self._context.free()
        self._gl.free()

    def __enter__(self) -> Self:
        """Return the renderer."""
        return self

    def __exit__(self, *exception: object) -> None:
        """Free the OpenGL context."""
        self.close()


def _camera_index(model: Any, camera: str) -> int:
    names = [model.camera(index).name for index in range(model.ncam)]
    if camera not in names:
        raise UserError(f"unknown camera {camera!r}; allowed: {', '.join(names)}")
    return names.index(camera)


def _upside_down(axes: NDArray[np.float64]) -> bool:
    """Whether the camera's up axis points down in the world."""
    return bool(axes[2, 1] < 0)


def _context(drawn_by: str, width: int, height: int) -> Any:
    """An off-screen OpenGL context of a back end."""
    check_platform(drawn_by, os.environ)
    try:
        if drawn_by == "egl":
            from mujoco.egl import GLContext
        elif drawn_by == "glfw":
            from mujoco.glfw import GLContext
        else:
            from mujoco.osmesa import GLContext
        return GLContext(width, height)
    except (ImportError, AttributeError, OSError, RuntimeError, TypeError) as error:
        raise UserError(MISSING_OSMESA if drawn_by == "osmesa" else _no_context(drawn_by, str(error))) from error


def _no_context(drawn_by: str, why: str) -> str:
    named = os.environ.get("MUJOCO_GL", "")
    display = " and needs a display" if drawn_by == "glfw" else ""
    return f"MUJOCO_GL={named}: draws by {drawn_by}{display}, but {why}; unset it: OSMesa needs neither display nor GPU"
