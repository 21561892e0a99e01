"""Which code a stage or an artefact consists of: its file, the method's, extensions, and parts that settings choose."""

from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any

from mtcsirl import names
from mtcsirl.extensions import LOADED
from mtcsirl.files.fingerprint import Code, code
from mtcsirl.irl.methods import METHODS
from mtcsirl.rewards.ground_truth import COMMON_SENSE_REWARDS
from mtcsirl.study.own_files import own_files

OPTIONAL: Mapping[str, Callable[[Mapping[str, Any]], bool]] = {
    "agents.reference": lambda settings: settings.get("sac", {}).get("learner") == "stable_baselines3",
    "agents.graph": lambda settings: settings.get("sac", {}).get("device", "cpu") != "cpu",
    "episodes.workers": lambda settings: False,
}
"""Modules that only some settings use. Worker processes change no byte, as a test holds."""


def code_of(stage: str, settings: Mapping[str, Any], method: str = "") -> Code:
    """The code of a stage of the DAG under the settings of its run."""
    unused = tuple(name for name, used in OPTIONAL.items() if not used(settings))
    return code((f"stages.{stage}", *_methods(method)), unused) | _extensions(method)


def artefact_code(*modules: str) -> Code:
    """The code of a table, a figure or another artefact that ``modules`` make."""
    return code(modules, tuple(OPTIONAL)) | _extensions("")


def _methods(method: str) -> tuple[str, ...]:
    """The module of a method of the package; one of an extension may be made from any of them."""
    if method in names.METHODS:
        return (f"irl.methods.{method}",)
    return tuple(f"irl.methods.{name}" for name in names.METHODS) if method in METHODS else ()


def _extensions(method: str) -> Code:
    """Extensions count where they are used: their cs-rewards are measured by all, a method by its own runs.

    One that adds nothing may have changed anything, and counts everywhere.
    """
    hashes: dict[str, set[str]] = {}
    for path in _used(method):
        for name, digest in own_files(path):
            hashes.setdefault(name, set()).add(digest)
    numbered = {name: list(enumerate(sorted(own))) for name, own in sorted(hashes.items())}
    files = {f"{name}#{i + 1}" if i else name: digest for name, own in numbered.items() for i, digest in own}
    return files | dict(_values())


def _used(method: str) -> Iterator[Path]:
    for path, extension in LOADED.items():
        if extension.cs_rewards or method in extension.methods or not extension.methods:
            yield path


def _values() -> Iterator[tuple[str, str]]:
    """What a cs-reward of one's own is made with, whatever file its numbers come from."""
    for name, reward in COMMON_SENSE_REWARDS.items():
        if name not in names.CS_REWARDS:
            yield f"{name}.target", repr(float(reward.target))
            yield f"{name}.unit", reward.unit
            yield f"{name}.weight", repr(float(reward.weight))
