"""What a run says of itself in ``provenance.json`` and ``gate.json``, each value checked where it is asked for."""

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from mtcsirl.errors import UserError
from mtcsirl.files import storage
from mtcsirl.files.identity import REMAKE
from mtcsirl.settings import Settings
from mtcsirl.study.runs import AnyRun


@dataclass(frozen=True)
class Reading:
    """A JSON file, or a part of one. Every method raises UserError with file and key where the value is another."""

    path: Path
    data: Any
    within: str = ""

    def at(self, *keys: str) -> Any:
        """The value below ``keys``."""
        found = self.data
        for key in keys:
            if not isinstance(found, dict) or key not in found:
                raise UserError(f"{self.path}: lacks {self._named(keys)}; {REMAKE}")
            found = found[key]
        return found

    def number(self, *keys: str) -> float:
        """A finite number."""
        found = self.at(*keys)
        if isinstance(found, bool) or not isinstance(found, int | float) or not math.isfinite(found):
            raise self._is(found, "a number", keys)
        return float(found)

    def number_or_none(self, *keys: str) -> float | None:
        """A finite number; null where there was none, as of a simulation that diverged."""
        return None if self.at(*keys) is None else self.number(*keys)

    def flag(self, *keys: str) -> bool:
        """True or false."""
        found = self.at(*keys)
        if not isinstance(found, bool):
            raise self._is(found, "true or false", keys)
        return found

    def text(self, *keys: str) -> str:
        """A text; what was not to be found out is null and reads as "unknown"."""
        found = self.at(*keys)
        if found is not None and (isinstance(found, bool) or not isinstance(found, str | int | float)):
            raise self._is(found, "a text", keys)
        return "unknown" if found is None else str(found)

    def texts(self, *keys: str) -> dict[str, str]:
        """Texts by name."""
        found = self.at(*keys)
        if not isinstance(found, dict):
            raise self._is(found, "texts by name", keys)
        return {name: self.text(*keys, name) for name in found}

    def parts(self, *keys: str) -> list["Reading"]:
        """The parts of a list."""
        found = self.at(*keys)
        if not isinstance(found, list):
            raise self._is(found, "a list", keys)
        return [Reading(self.path, part, f"{self._named(keys)}[{index}]") for index, part in enumerate(found)]

    def _is(self, found: Any, wanted: str, keys: tuple[str, ...]) -> UserError:
        return UserError(f"{self.path}: {self._named(keys)} is {str(found)[:40]!r}, not {wanted}; {REMAKE}")

    def _named(self, keys: tuple[str, ...]) -> str:
        return ".".join([self.within, *keys] if self.within else keys)


def provenance_of(run: AnyRun, settings: Settings) -> Reading:
    """The provenance of a run; raises UserError where it is lost or no JSON."""
    return _reading(run, settings, "provenance.json")


def gate_of(run: AnyRun, settings: Settings) -> Reading:
    """The gate of a run, as :func:`provenance_of`."""
    return _reading(run, settings, "gate.json")


def _reading(run: AnyRun, settings: Settings, name: str) -> Reading:
    path = Path(settings.results) / run.folder / name
    return Reading(path, storage.read_json(path))
