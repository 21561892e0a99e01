"""Whether this machine can draw a scene without a screen; what cannot be drawn is said in words instead."""

import ctypes
import os
import subprocess
import sys
from functools import cache

from mtcsirl.errors import UserError
from mtcsirl.worlds.rendering import MISSING_OSMESA
from mtcsirl.worlds.variables import backend, check_platform

VARIABLE = "MTCSIRL_NOT_RENDERED"
"""Hands the answer of a workflow to its jobs, which may run elsewhere; empty: scenes are drawn."""
_TRY = (
    "import mujoco; from mtcsirl.errors import UserError; from mtcsirl.worlds.rendering import SceneRenderer\n"
    "try: SceneRenderer(mujoco.MjModel.from_xml_string('<mujoco/>'), width=8, height=8).close()\n"
    "except UserError as error: print(error)"
)


def lacking() -> str | None:
    """Why scenes cannot be drawn, with the remedy; None: they can."""
    told = os.environ.get(VARIABLE)
    return _lacking() if told is None else told or None


@cache
def _lacking() -> str | None:
    try:
        drawn_by = backend(os.environ)
        check_platform(drawn_by, os.environ)
    except UserError as error:
        return str(error)
    if drawn_by == "osmesa":
        return None if _osmesa() else MISSING_OSMESA
    # a driver may end its process, so it is tried in another one
    done = subprocess.run([sys.executable, "-c", _TRY], capture_output=True, text=True, check=False)
    if done.returncode:
        return f"MUJOCO_GL={os.environ['MUJOCO_GL']}: its driver ends the process; unset it: OSMesa needs no GPU"
    return done.stdout.strip() or None


def _osmesa() -> bool:
    """Whether the library loads under one of the names that PyOpenGL tries."""
    for name in ("libOSMesa.so", *(f"libOSMesa.so.{number}" for number in reversed(range(10)))):
        try:
            ctypes.CDLL(name)
        except OSError:
            continue
        return True
    return False
