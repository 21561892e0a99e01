"""Where the verbs that read a study leave what they make, and the note of what that was made from."""

import argparse
from collections.abc import Mapping, Sequence
from pathlib import Path

from mtcsirl.settings import Settings
from mtcsirl.study.artefacts import sign_artefact, unsign_artefact
from mtcsirl.study.design import design
from mtcsirl.study.folders import check_without_run
from mtcsirl.study.partial import done_runs, forget_partial, note_partial

Place = tuple[Path, Path]
"""A folder that is written to, and the one where the DAG looks."""


def place(given: Path | None, home: Path) -> Place:
    """``given`` if it is, else ``home``; and ``home``.

    Raises:
        UserError: a run is there, whose files would be replaced, or joined by one that is not its own.
    """
    folder = given or home
    check_without_run(folder)
    return folder, home


def to_be_read(parsed: argparse.Namespace, settings: Settings, name: str) -> dict[str, str]:
    """The runs that a page of a part of the study shows; asked before it is made, as more may end meanwhile."""
    return done_runs(design(settings, name), settings) if parsed.partial else {}


def note(
    name: str,
    settings: Settings,
    places: Sequence[Place],
    *,
    partial: bool,
    read: Mapping[str, str] | None = None,
    files: str = "",
) -> None:
    """Note what the files ``name``.* (or ``files``) were made from, where all of them lie at home.

    What is of a part of the study is not signed; with ``read``, of ``to_be_read``, it is noted for the report. A note
    that spoke of other files than lie there now is withdrawn.
    """
    at_home = [folder.resolve() == home.resolve() for folder, home in places]
    if not any(at_home):
        return
    made = sorted({file for folder, _ in places for file in folder.glob(files or f"{name}.*")})
    forget_partial(name, settings)
    if all(at_home) and not partial:
        sign_artefact(name, settings, made)
        return
    unsign_artefact(name, settings)
    if all(at_home) and read is not None:
        note_partial(name, settings, made, read)
