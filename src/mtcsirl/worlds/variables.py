"""The environment variables that say how MuJoCo draws, checked before its import: a wrong one ends it."""

from collections.abc import Mapping

from mtcsirl.errors import UserError

DRAWN_BY = {
    **dict.fromkeys(("", "osmesa", "disable", "disabled", "off", "false", "0"), "osmesa"),
    **dict.fromkeys(("glfw", "glx", "enable", "enabled", "on", "true", "1"), "glfw"),
    "egl": "egl",
}
"""Value of MUJOCO_GL -> back end of pictures without a screen; nothing, or none: OSMesa, which needs no display."""


def backend(variables: Mapping[str, str]) -> str:
    """The back end that ``MUJOCO_GL`` names.

    Raises UserError for a value that MuJoCo does not know, or that ``PYOPENGL_PLATFORM`` contradicts.
    """
    named = variables.get("MUJOCO_GL", "")
    drawn_by = DRAWN_BY.get(named.lower().strip())
    if drawn_by is None:
        raise UserError(f"MUJOCO_GL={named}: MuJoCo knows no such back end; unset it, or set it to osmesa or egl")
    if named.lower().strip() in ("egl", "osmesa"):
        check_platform(drawn_by, variables)
    return drawn_by


def check_platform(drawn_by: str, variables: Mapping[str, str]) -> None:
    """Raise UserError where ``PYOPENGL_PLATFORM`` names another back end than the one that draws."""
    platform = variables.get("PYOPENGL_PLATFORM", "")
    if drawn_by != "glfw" and platform and platform.lower() != drawn_by:
        gl = variables.get("MUJOCO_GL", "")
        because = f"MUJOCO_GL={gl} draws" if gl else "pictures are drawn"
        raise UserError(f"PYOPENGL_PLATFORM={platform}: {because} by {drawn_by}; unset it, or name {drawn_by} there")
