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


def load_extensions(files: Iterable[str | Path]) -> None:
    """Run each file once per process; it adds to ``METHODS`` or ``COMMON_SENSE_REWARDS``.

    Raises:
        UserError: a file is missing, fails or ends the program.
    """
    for file in files:
        path = Path(file).resolve()
        name = f"mtcsirl_extension_{path.stem}"
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
        except SystemExit as error:
            if error.__class__ is not SystemExit:  # a signal that ends this process
                raise
            raise UserError(f"extensions: {file}: ends the program (sys.exit); an extension must not") from error
        except Exception as error:
            says = " ".join(str(error).split())
            raise UserError(f"extensions: {file}: {type(error).__name__}: {says}") from error
        sys.modules[name] = module


def load_from_environment() -> None:
    """Load what the environment variable lists."""
    load_extensions(file for file in os.environ.get(VARIABLE, "").split(os.pathsep) if file)
