"""Methods and cs-rewards of one's own: Python files that add to the registries, outside the package.

The configuration lists them (``extensions``); whoever validates it loads them first. A job of the DAG learns of them by
the environment variable ``MTCSIRL_EXTENSIONS``, which the Snakefile sets, since its command line names what they add.
"""

import importlib.util
import os
import sys
from collections.abc import Iterable
from pathlib import Path

from mtcsirl.errors import UserError

VARIABLE = "MTCSIRL_EXTENSIONS"
MODULE_PREFIX = "mtcsirl_extension_"


def load_extensions(files: Iterable[str | Path]) -> None:
    """Run each file once per process; it adds to ``METHODS`` or ``COMMON_SENSE_REWARDS``.

    Raises:
        UserError: a file is missing or fails.
    """
    for file in files:
        path = Path(file).resolve()
        name = f"{MODULE_PREFIX}{path.stem}"
        known = sys.modules.get(name)
        if known is not None and known.__file__ == str(path):
            continue
        if not path.is_file():
            raise UserError(f"extensions: {file}: no such file")
        spec = importlib.util.spec_from_file_location(name, path)
        assert spec is not None
        assert spec.loader is not None
        module = importlib.util.module_from_spec(spec)
        try:
            spec.loader.exec_module(module)
        except Exception as error:
            raise UserError(f"extensions: {file}: {type(error).__name__}: {error}") from error
        sys.modules[name] = module


def load_from_environment() -> None:
    """Load what the environment variable lists."""
    load_extensions(file for file in os.environ.get(VARIABLE, "").split(os.pathsep) if file)
