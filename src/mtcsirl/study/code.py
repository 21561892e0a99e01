"""Which code a stage or an artefact consists of: its file, the method's, extensions, and parts that settings choose."""

import sys
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from mtcsirl.extensions import MODULE_PREFIX
from mtcsirl.files.definitions import file_hash, path_of
from mtcsirl.files.fingerprint import Code, code
from mtcsirl.irl.methods import METHODS
from mtcsirl.rewards.ground_truth import COMMON_SENSE_REWARDS

OPTIONAL: Mapping[str, Callable[[Mapping[str, Any]], bool]] = {
    "agents.reference": lambda settings: settings.get("sac", {}).get("learner") == "stable_baselines3",
    "agents.graph": lambda settings: settings.get("sac", {}).get("device", "cpu") != "cpu",
    "episodes.workers": lambda settings: False,
}
"""Modules that only some settings use. Worker processes change no byte, as a test holds."""


def code_of(stage: str, settings: Mapping[str, Any], method: str = "") -> Code:
    """The code of a stage of the DAG under the settings of its run."""
    unused = tuple(name for name, used in OPTIONAL.items() if not used(settings))
    own = f"irl.methods.{method}"
    modules = (f"stages.{stage}", own) if method and path_of(own) is not None else (f"stages.{stage}",)
    return code(modules, unused) | _extensions(method)


def artefact_code(*modules: str) -> Code:
    """The code of a table, a figure or another artefact that ``modules`` make."""
    return code(modules, tuple(OPTIONAL)) | _extensions("")


def _extensions(method: str) -> Code:
    """Extension files count where they are used: their cs-rewards are measured by all, a method by its own runs."""
    used: list[Any] = [reward.measure for reward in COMMON_SENSE_REWARDS.values()]
    if method in METHODS:
        used.append(METHODS[method])
    modules = {getattr(function, "__module__", "") for function in used}
    files = [sys.modules[name].__file__ for name in modules if name.startswith(MODULE_PREFIX)]
    return {Path(file).name: file_hash(Path(file)) for file in files if file}
