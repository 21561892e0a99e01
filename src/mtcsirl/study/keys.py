"""What all runs have: a key, the folder that mirrors it, settings, what they read, and an identity.

Pure data for the DAG, the command line, the cost plan and the tests. Imports no torch and touches no file.
"""

from __future__ import annotations

import re
from abc import ABC, abstractmethod
from collections.abc import Mapping
from string import Formatter
from typing import Any, ClassVar, Generic, TypeVar

from mtcsirl.files.identity import Identity
from mtcsirl.settings import Settings
from mtcsirl.settings.base import Frozen, identifying
from mtcsirl.settings.loading import merge, validate
from mtcsirl.study.ablations import changes, prefix
from mtcsirl.study.code import code_of

S = TypeVar("S", bound=Frozen, covariant=True)


def varied(settings: Settings, variant: str) -> Settings:
    """``settings`` with the changes of a variant, as in ``ablation_replay/latest``; the main study has none."""
    return validate(Settings, merge(settings.model_dump(mode="json"), changes(variant))) if variant else settings


class Run(ABC, Generic[S]):
    """One job of the DAG whose settings are an ``S``."""

    stage: ClassVar[str]
    PATTERN: ClassVar[str]
    """The folder below the results, with the key's names as fields; also the wildcards of the stage's rule."""

    @property
    @abstractmethod
    def key(self) -> dict[str, Any]:
        """The fields of ``PATTERN``."""

    @abstractmethod
    def settings(self, settings: Settings) -> S:
        """The slice of the configuration that the run depends on."""

    @property
    def needs(self) -> Mapping[str, Run[Any]]:
        """The runs that this one reads, by role."""
        return {}

    @property
    def about(self) -> dict[str, Any]:
        """What the stage is told beside settings and inputs: the part of the key that its numbers depend on."""
        return {name: value for name, value in self.key.items() if name != "variant"}

    @property
    def folder(self) -> str:
        """Where the run lands, below the results folder."""
        return self.PATTERN.format(**self.key)

    def identity(self, settings: Settings) -> Identity:
        """What the run is made from under ``settings``."""
        own = self.settings(settings)
        inputs = {role: identity_of(run, settings).hash for role, run in self.needs.items()}
        return identity(self.stage, self.about, own, inputs)


def identity(stage: str, about: Mapping[str, Any], own: Frozen, inputs: Mapping[str, str]) -> Identity:
    """The identity of a run with the settings ``own`` over inputs, role -> hash of their identity."""
    said = identifying(own)
    return Identity(stage, dict(about), said, code_of(stage, said, about.get("method", "")), dict(inputs))


_KNOWN: dict[tuple[Run[Any], int], tuple[Settings, Identity]] = {}


def identity_of(run: Run[Any], settings: Settings) -> Identity:
    """``run.identity(settings)``, computed once."""
    place = run, id(settings)
    if place not in _KNOWN:
        _KNOWN[place] = settings, run.identity(settings)  # keeps ``settings`` alive, so that its id stays its own
    return _KNOWN[place][1]


def read_folder(pattern: str, folder: str) -> dict[str, str] | None:
    """The key of a folder that ``pattern`` made; None if it is of another kind."""
    parts = Formatter().parse(pattern)
    found = re.fullmatch("".join(re.escape(text) + (_field(name) if name else "") for text, name, *_ in parts), folder)
    return found.groupdict() if found else None


FIELDS = {"variant": r"(?:ablations/\w+/\w+/)?", "target": r"\d+", "seed": r"\d+"}
"""What a field of a pattern may be, where that is not any name."""


def _field(name: str) -> str:
    return rf"(?P<{name}>{FIELDS.get(name, '[^/]+?')})"


def key_of(run: Any, *names: str) -> dict[str, Any]:
    """The values of the fields ``names`` of a run, with the folder of its variant."""
    return {"variant": prefix(getattr(run, "variant", ""))} | {name: getattr(run, name) for name in names}
