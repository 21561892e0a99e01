"""The IRL methods, a file each: the function ``<name>`` of ``<name>.py`` here, its name in ``names.py``.

A file is imported when its method is built.
"""

from importlib import import_module

from mtcsirl import names
from mtcsirl.extensions import METHODS, Builder

__all__ = ["METHODS"]


def _builder(name: str) -> Builder:
    return lambda setup: getattr(import_module(f"mtcsirl.irl.methods.{name}"), name)(setup)


METHODS.update({name: _builder(name) for name in names.METHODS})
