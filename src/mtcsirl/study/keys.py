"""What all runs have: a key, the folder that mirrors it, settings, what they read, and an identity.

Pure data for the DAG, the command line, the cost plan and the tests. Imports no torch and touches no file.
"""

from __future__ import annotations

import re
from abc import ABC, abstractmethod
from collections.abc import Callable, Hashable, Mapping
from dataclasses import replace
from string import Formatter
from typing import Any, ClassVar, Generic, TypeVar

from mtcsirl.files.identity import Identity
from mtcsirl.settings import Settings
from mtcsirl.settings.base import Frozen, identifying
from mtcsirl.settings.loading import merge, validate
from mtcsirl.study.ablations import changes, prefix
from mtcsirl.study.code import code_of

S = TypeVar("S", bound=Frozen, covariant=True)
Slice = TypeVar("Slice", bound=Frozen)


_SLICES: dict[tuple[Any, ...], tuple[Settings, Any]] = {}


def sliced(make: Callable[..., Slice], settings: Settings, *about: Hashable) -> Slice:
    """``make(settings, *about)``, computed once: runs that differ in their seed alone share their settings."""
    place = make, id(settings), *about
    if place not in _SLICES:
        _SLICES[place] = settings, make(settings, *about)  # keeps ``settings`` alive, so that its id stays its own
    made: Slice = _SLICES[place][1]
    return made


def varied(settings: Settings, variant: str) -> Settings:
    """``settings`` with the changes of a variant, as in ``ablation_replay/latest``; the main study has none."""
    return sliced(_changed, settings, variant) if variant else settings


def _changed(settings: Settings, variant: str) -> Settings:
    return validate(Settings, merge(settings.model_dump(mode="json"), changes(variant)))


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
        return replace(_alike(self.stage, self.about, own), key=self.about, inputs=inputs)


def identity(stage: str, about: Mapping[str, Any], own: Frozen, inputs: Mapping[str, str]) -> Identity:
    """The identity of a run with the settings ``own`` over inputs, role -> hash of their identity."""
    said = identifying(own)
    return Identity(stage, dict(about), said, code_of(stage, said, about.get("method", "")), dict(inputs))


_ALIKE: dict[tuple[str, int, str], tuple[Frozen, Identity]] = {}


def _alike(stage: str, about: Mapping[str, Any], own: Frozen) -> Identity:
    """An identity with the settings and the code of all runs that share the settings ``own``."""
    place = stage, id(own), about.get("method", "")
    if place not in _ALIKE:
        _ALIKE[place] = own, identity(stage, about, own, {})
    return _ALIKE[place][1]


_KNOWN: dict[tuple[Run[Any], int], tuple[Settings, Identity]] = {}


def identity_of(run: Run[Any], settings: Settings) -> Identity:
    """``run.identity(settings)``, computed once."""
    place = run, id(settings)
    if place not in _KNOWN:
        _KNOWN[place] = settings, run.identity(settings)
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
