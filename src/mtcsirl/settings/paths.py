"""Paths in a configuration: taken as they are written, by every shell, Snakemake and the package alike."""

import os
import re
from pathlib import Path
from typing import Annotated

from pydantic import AfterValidator

WILD = re.compile(r"[{}<>\x00-\x1f\x7f]")
"""What Snakemake takes for a wildcard or a variable, and control characters."""

_CHECKOUT = Path(__file__).resolve().parents[3]
_SOURCE = ("src", "tests", "workflow", "config", "profiles", "benchmarks", "containers", "docs", "examples", "website")
_BUILT = ("audit", "constraints", "imitation", "sbx", "site")
"""What make builds below build/, some of it in a folder that is emptied first."""
_PART = ("part-0001", "manifest.json")
"""The first part of an evidence archive, and what names it one."""


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


def _to_be_filled(path: str) -> str:
    """``path``, or ValueError: what a study writes there would be lost among, or replace, what is no result."""
    place = Path(os.path.realpath(path))
    there = next(one for one in (place, *place.parents) if one.exists())
    if not there.is_dir():
        what = "a file" if there.is_file() else "a device"
        raise ValueError(f"{'it' if there == place else there} is {what}; name a folder")
    if place == place.parent:
        raise ValueError("the root of all folders; name one for the study alone")
    archive = next((one for one in (place, *place.parents) if os.path.isfile(one.joinpath(*_PART))), None)
    if archive is not None:
        raise ValueError(f"{'it' if archive == place else archive} holds an archive of runs; name a folder beside it")
    for one in (place, Path(os.path.abspath(path))):  # .venv may be a link to elsewhere
        if (_CHECKOUT / "Snakefile").is_file() and one.is_relative_to(_CHECKOUT):
            _check_inside(one.relative_to(_CHECKOUT).parts)
    return path


def _check_inside(parts: tuple[str, ...]) -> None:
    """Raise ValueError where the folder of these ``parts`` below the checkout is not free for a study."""
    if not parts or parts[0] in _SOURCE or parts[0].startswith("."):
        raise ValueError("a folder of this suite's own source; name another, for example results")
    if parts[0] == "build" and (len(parts) == 1 or parts[1] in _BUILT):
        raise ValueError("make builds there and may empty it; name another, for example build/check")


Folder = Annotated[
    str,
    AfterValidator(_literal),
    AfterValidator(os.path.normpath),
    AfterValidator(_literal),
    AfterValidator(_to_be_filled),
]
"""A folder that a study may fill; ``results/`` is ``results``."""
PathText = Annotated[str, AfterValidator(_literal)]
"""A file."""
