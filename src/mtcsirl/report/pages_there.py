"""Which tables, figures and verdicts the page may show: those whose files are what was written under these settings."""

import os
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TypeVar

from mtcsirl.errors import MissingError, UserError
from mtcsirl.files.identity import Record
from mtcsirl.settings import Settings
from mtcsirl.study.artefacts import record_folder
from mtcsirl.study.design import CLAIMS
from mtcsirl.study.partial import done_since, page_standing
from mtcsirl.study.screen import first_of
from mtcsirl.study.standing import DONE, STALE, own_reasons

Shown = TypeVar("Shown")


def file_of(name: str, settings: Settings) -> Path:
    """The file of an artefact that the page reads first."""
    if name.startswith("figure_"):
        return Path(settings.figures) / f"{name}.png"
    return Path(settings.results) / ("claims" if name == CLAIMS else "tables") / f"{name}.json"


@dataclass
class PagesThere:
    """The artefacts that may be shown, and why others may not.

    ``partial``: whatever lacks is noted; otherwise it is a MissingError. ``done``: the runs of the study that are done.
    """

    settings: Settings
    done: Mapping[str, str]
    partial: bool
    missing: list[str] = field(default_factory=list)
    """Artefacts that nobody has made yet."""
    _left_out: dict[str, list[str]] = field(default_factory=dict)
    """Why -> which."""
    _older: dict[int, list[str]] = field(default_factory=dict)
    """How many runs have been done since -> which."""

    def read(self, name: str, show: Callable[[str, Record], Shown]) -> Shown | None:
        """What ``show`` makes of an artefact and its record; None where it may not be shown."""
        file = file_of(name, self.settings)
        if not file.is_file():
            self._lacks(name, file, "not there")
            return None
        found = page_standing(name, self.settings, self.done)
        if found.state != DONE or found.record is None:
            changed = f"made from other settings, code or runs: {first_of(own_reasons(found.why))}"
            self._lacks(name, file, changed if found.state == STALE else "; ".join(found.why))
            return None
        try:
            if not is_signed(file, name, self.settings, found.record):
                raise UserError("signed in another folder")
            shown = show(name, found.record)
        except UserError as error:
            self._lacks(name, file, str(error))
            return None
        if since := done_since(found.record, self.done):
            self._older.setdefault(since, []).append(name)
        return shown

    def _lacks(self, name: str, file: Path, why: str) -> None:
        if not self.partial:
            raise MissingError(why if why.startswith(f"{file}: ") else f"{file}: {why}")
        if why == "not there":
            self.missing.append(name)
        else:
            self._left_out.setdefault(why, []).append(name)

    @property
    def cautions(self) -> tuple[str, ...]:
        """One line per reason, with the way out."""
        left = [f"Left out: {_listed(names)} ({why}). {_again(names)}" for why, names in self._left_out.items()]
        old = [
            f"Older than {since} of {'its' if len(names) == 1 else 'their'} runs: {_listed(names)}. {_again(names)}"
            for since, names in self._older.items()
        ]
        return (*left, *old)


def is_signed(file: Path, name: str, settings: Settings, record: Record) -> bool:
    """Whether a record of the artefact ``name`` answers for ``file``."""
    return Path(os.path.relpath(file, record_folder(name, settings.results))).as_posix() in record.files


def _listed(names: Iterable[str]) -> str:
    parts = (name.partition("_") for name in names)
    return ", ".join(f"{kind.capitalize()} {number.upper()}".rstrip() for kind, _, number in parts)


def _again(names: list[str]) -> str:
    first = f"mtcsirl {names[0].replace('_', ' ')} --partial"
    return f"Make {'it' if len(names) == 1 else 'each'} again with these settings, as by `{first}`."
