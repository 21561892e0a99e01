"""The code of a result: every definition that its stage can reach, with the hash of each.

The walk starts from the definitions of the stage's own file and follows names. It stops at definitions that cannot
change a number (how a job is locked, logged and signed), and at parts that only some settings use.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterable
from functools import cache
from typing import Any

import yaml

from mtcsirl.files.definitions import PACKAGE, Definition, examine, load

NEUTRAL = (
    "errors",
    "extensions",
    "files.lock",
    "files.stop",
    "files.provenance",
    "files.identity",
    "files.definitions",
    "files.fingerprint",
    "files.checkpoint",
    "settings",
    "agents.progress",
    "stages.running",
    "study",
)
"""Modules that decide no number: how a job is kept, and settings, which enter by value."""
NOT_NEUTRAL = ("settings.template",)
"""What tables print of settings."""

Code = dict[str, str]
"""Name of a definition or data file -> its hash; equal names in several modules are numbered."""


@cache
def code(modules: tuple[str, ...], without: tuple[str, ...] = ()) -> Code:
    """What the public definitions of ``modules`` reach, but for ``NEUTRAL`` and the modules ``without``."""
    left = [Definition(module, name) for module in modules for name in load(module).definitions]
    found: set[Definition] = set()
    data: set[str] = set()
    while left:
        definition = left.pop()
        if definition in found or (definition.module not in modules and _left_out(definition, without)):
            continue
        found.add(definition)
        _, others, files = examine(definition)
        left += others
        data |= files
    return _named(found) | {name: _data_hash(name) for name in sorted(data)}


def _left_out(definition: Definition, without: Iterable[str]) -> bool:
    return _under(definition, without) or (_under(definition, NEUTRAL) and not _under(definition, NOT_NEUTRAL))


def _under(definition: Definition, parts: Iterable[str]) -> bool:
    return any(f"{definition}.".startswith(f"{part}.") for part in parts)


def _named(found: set[Definition]) -> Code:
    """Sorted by name and hash, so that neither modules nor their order count."""
    hashes: dict[str, set[str]] = {}
    for definition in found:
        hashes.setdefault(definition.name, set()).add(examine(definition)[0])
    named: Code = {}
    for name, own in sorted(hashes.items()):
        for index, digest in enumerate(sorted(own)):
            named[f"{name}#{index + 1}" if index else name] = digest
    return named


@cache
def _data_hash(name: str) -> str:
    """YAML by what it says, so that comments do not count; other files by their bytes."""
    content = (PACKAGE / name).read_bytes()
    if name.endswith(".yaml"):
        content = json.dumps(yaml.safe_load(content), sort_keys=True).encode()
    return hashlib.sha256(content).hexdigest()[:12]


def digest(data: Any) -> str:
    """SHA-256 of plain data as canonical JSON, its first 16 hexadecimal digits."""
    text = json.dumps(data, sort_keys=True, separators=(",", ":"), allow_nan=False)
    return hashlib.sha256(text.encode()).hexdigest()[:16]
