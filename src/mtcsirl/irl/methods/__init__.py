"""The IRL methods, a file each: the function ``<name>`` of ``<name>.py`` here, its name in ``names.py``.

A file is imported when its method is built.
"""

from __future__ import annotations

from dataclasses import replace
from importlib import import_module
from typing import TYPE_CHECKING

from mtcsirl import names
from mtcsirl.extensions import BUILDERS, METHODS, Builder, probe_methods_with

if TYPE_CHECKING:
    from mtcsirl.irl.discriminator import Method
    from mtcsirl.irl.methods.base import Setup

__all__ = ["METHODS", "make_method"]


def _builder(name: str) -> Builder:
    return lambda setup: getattr(import_module(f"mtcsirl.irl.methods.{name}"), name)(setup)


def _probe(build: Builder) -> None:
    from mtcsirl.irl.methods.probe import check_method

    check_method(build)


BUILDERS.update({name: _builder(name) for name in names.METHODS})
probe_methods_with(_probe)


def make_method(name: str, setup: Setup) -> Method:
    """The method that is registered as ``name``."""
    made: Method = replace(METHODS[name](setup), name=name)
    return made
