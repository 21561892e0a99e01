"""Imports Meta-World without what no training needs: 0.3 s for each of a thousand jobs.

The tasks import ``scipy.spatial.transform.Rotation`` for one quaternion, and the fast ones replace that
(:mod:`mtcsirl.worlds.fast.borrowed`). glfw and imageio are for windows and picture files. While Meta-World is imported,
stand-ins take their places; who asks one of them for something, as the stock tasks do, gets it from the true module.
"""

import importlib
import sys
from types import ModuleType
from typing import Any

_LATER: dict[str, tuple[str, ...]] = {"scipy.spatial.transform": ("Rotation",), "glfw": (), "imageio": ()}
"""Modules, and what Meta-World takes out of them by ``from``."""


class _Later(ModuleType):
    """Stands in for a module, or for something in it, until an attribute is looked up."""

    def __init__(self, name: str, *inner: str) -> None:
        super().__init__(name)
        self._inner = inner

    def __getattr__(self, name: str) -> Any:
        if isinstance(sys.modules.get(self.__name__), _Later):  # Meta-World is being imported, and takes names only
            raise AttributeError(name)
        found = importlib.import_module(self.__name__)
        for step in self._inner:
            found = getattr(found, step)
        return getattr(found, name)


def import_meta_world() -> None:
    """Import Meta-World's tasks; what is loaded already stays as it is."""
    stand_ins = {name: _Later(name) for name in _LATER if name not in sys.modules}
    for name, stand_in in stand_ins.items():
        vars(stand_in).update({inner: _Later(name, inner) for inner in _LATER[name]})
    sys.modules.update(stand_ins)
    try:
        importlib.import_module("metaworld.env_dict")
    finally:
        for name in stand_ins:
            del sys.modules[name]
