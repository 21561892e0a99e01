"""Paths in a configuration: taken as they are written, by every shell, Snakemake and the package alike."""

import os
import re
from typing import Annotated

from pydantic import AfterValidator

WILD = re.compile(r"[{}<>\x00-\x1f\x7f]")
"""What Snakemake takes for a wildcard or a variable, and control characters."""


def _literal(path: str) -> str:
    """``path``, or ValueError: a part of it would be read as something else somewhere."""
    if not path.strip():
        raise ValueError("must not be empty")
    if path.startswith("~") or re.search(r"\$\w|\$\{", path):
        raise ValueError(f"~ and variables are not expanded here; write {_expanded(path)}")
    wild = WILD.search(path)
    if wild:
        raise ValueError(f"must not hold the character {wild.group()!r}")
    if path.startswith("-"):
        raise ValueError("would be taken for an option; write the whole path")
    return path


def _expanded(path: str) -> str:
    expanded = os.path.expanduser(os.path.expandvars(path))
    return "the path itself" if expanded == path or "$" in expanded else expanded


Folder = Annotated[str, AfterValidator(_literal), AfterValidator(os.path.normpath), AfterValidator(_literal)]
"""A folder; ``results/`` is ``results``."""
PathText = Annotated[str, AfterValidator(_literal)]
"""A file."""
