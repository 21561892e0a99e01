"""Meta-World without scipy, which takes longer to import than all of its 50 tasks.

The tasks import ``scipy.spatial.transform.Rotation`` for one quaternion, and the fast ones replace that
(:mod:`mtcsirl.worlds.fast.borrowed`). While Meta-World is imported, a stand-in takes the place of scipy's module; the
stock tasks get the true class from it when they first ask for something.
"""

import sys
from types import ModuleType
from typing import Any

_MODULE = "scipy.spatial.transform"


class _Rotation:
    """``scipy.spatial.transform.Rotation``, imported at the first use."""

    def __getattr__(self, name: str) -> Any:
        from scipy.spatial.transform import Rotation

        return getattr(Rotation, name)


def import_meta_world() -> None:
    """Import Meta-World's tasks, and scipy only where it is there already."""
    if _MODULE in sys.modules or "metaworld" in sys.modules:
        return
    stand_in = ModuleType(_MODULE)
    stand_in.__dict__["Rotation"] = _Rotation()
    sys.modules[_MODULE] = stand_in
    try:
        import metaworld.env_dict  # noqa: F401
    finally:
        del sys.modules[_MODULE]
