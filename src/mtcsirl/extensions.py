"""The registry of IRL methods, and Python files outside the package that add to it or to that of the cs-rewards.

A configuration is checked against the registry of methods without torch, so those of the package stand here by name
alone; ``irl/methods`` puts in what builds them.

The configuration lists them (``extensions``); whoever validates it loads them first. A job of the DAG learns of them by
the environment variable ``MTCSIRL_EXTENSIONS``, which the Snakefile sets, since its command line names what they add.
"""

from __future__ import annotations

import importlib.util
import os
import sys
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

from mtcsirl import names
from mtcsirl.errors import UserError

VARIABLE = "MTCSIRL_EXTENSIONS"
MODULE_PREFIX = "mtcsirl_extension_"


Builder = Callable[[Any], Any]
"""From a ``Setup`` to a ``Method``; both are of ``irl``, which stands above this module."""


def _by_name_alone(setup: Any) -> Any:
    raise RuntimeError("take METHODS from mtcsirl.irl.methods, which can build them")


METHODS: dict[str, Builder] = dict.fromkeys(names.METHODS, _by_name_alone)
"""Every method by name, and what builds it."""


def load_extensions(files: Iterable[str | Path]) -> None:
    """Run each file once per process; it adds to ``METHODS`` or ``COMMON_SENSE_REWARDS``.

    Raises:
        UserError: a file is missing, fails or ends the program.
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
        except SystemExit as error:
            if error.__class__ is not SystemExit:  # a signal that ends this process
                raise
            raise UserError(f"extensions: {file}: ends the program (sys.exit); an extension must not") from error
        except Exception as error:
            says = " ".join(str(error).split())
            raise UserError(f"extensions: {file}: {type(error).__name__}: {says}") from error
        sys.modules[module_name] = module


def load_from_environment() -> None:
    """Load what the environment variable lists."""
    load_extensions(file for file in os.environ.get(VARIABLE, "").split(os.pathsep) if file)
