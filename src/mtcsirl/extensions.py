"""The registry of IRL methods, and Python files outside the package that add to it or to that of the cs-rewards.

A method of the package is the function ``<name>`` of ``irl/methods/<name>.py``, imported when it is built, so that a
configuration can be checked against the registry without torch.

The configuration lists them (``extensions``); whoever validates it loads them first. A job of the DAG learns of them by
the environment variable ``MTCSIRL_EXTENSIONS``, which the Snakefile sets, since its command line names what they add.
"""

from __future__ import annotations

import importlib.util
import os
import sys
from collections.abc import Callable, Iterable
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING

from mtcsirl import names
from mtcsirl.errors import UserError

if TYPE_CHECKING:
    from mtcsirl.irl.discriminator import Method
    from mtcsirl.irl.methods.base import Setup

VARIABLE = "MTCSIRL_EXTENSIONS"
MODULE_PREFIX = "mtcsirl_extension_"


def _builder(name: str) -> Callable[[Setup], Method]:
    def build(setup: Setup) -> Method:
        method: Method = getattr(import_module(f"mtcsirl.irl.methods.{name}"), name)(setup)
        return method

    return build


METHODS: dict[str, Callable[[Setup], Method]] = {name: _builder(name) for name in names.METHODS}
"""Every method by name, and what builds it."""


def load_extensions(files: Iterable[str | Path]) -> None:
    """Run each file once per process; it adds to ``METHODS`` or ``COMMON_SENSE_REWARDS``.

    Raises:
        UserError: a file is missing or fails.
    """
    for file in files:
        if os.pathsep in str(file):
            raise UserError(f"extensions: {file}: must not hold {os.pathsep!r}, which separates files in {VARIABLE}")
        path = Path(file).resolve()
        module_name = f"{MODULE_PREFIX}{path.stem}"
        known = sys.modules.get(module_name)
        if known is not None and known.__file__ == str(path):
            continue
        if not path.is_file():
            raise UserError(f"extensions: {file}: no such file")
        spec = importlib.util.spec_from_file_location(module_name, path)
        assert spec is not None
        assert spec.loader is not None
        module = importlib.util.module_from_spec(spec)
        try:
            spec.loader.exec_module(module)
        except Exception as error:
            raise UserError(f"extensions: {file}: {type(error).__name__}: {error}") from error
        sys.modules[module_name] = module


def load_from_environment() -> None:
    """Load what the environment variable lists."""
    load_extensions(file for file in os.environ.get(VARIABLE, "").split(os.pathsep) if file)
