"""A machine that lacks something, without uninstalling it: a module that every Python of a process tree loads first."""

import os
import sys
from pathlib import Path

OSMESA = """
import ctypes
class WithoutOsmesa(ctypes.CDLL):
    def __init__(self, name, *rest, **more):
        if name and "OSMesa" in str(name):
            raise OSError(f"{name}: cannot open shared object file")
        super().__init__(name, *rest, **more)
ctypes.CDLL, ctypes.cdll = WithoutOsmesa, ctypes.LibraryLoader(WithoutOsmesa)
"""
OF_DRAWING = ("MUJOCO_GL", "PYOPENGL_PLATFORM", "DISPLAY", "MTCSIRL_NOT_RENDERED")


def environment(folder: Path, source: Path, *, osmesa: bool = False, path: bool = True) -> dict[str, str]:
    """The variables of a process that finds neither OSMesa, a display nor (``path`` false) any program but Python."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "sitecustomize.py").write_text("" if osmesa else OSMESA)
    own = {name: value for name, value in os.environ.items() if name not in OF_DRAWING}
    own["PYTHONPATH"] = os.pathsep.join((str(folder), str(source)))
    if not path:
        own["PATH"] = os.pathsep.join((str(Path(sys.executable).parent), "/bin"))
    return own
