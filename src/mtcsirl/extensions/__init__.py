"""The registry of IRL methods, and Python files outside the package that add to it or to that of the cs-rewards.

A configuration is checked against the registry of methods without torch; ``irl/methods`` puts in what builds those of
the package, and a probe that those of an extension must pass.

The configuration lists them (``extensions``); whoever validates it loads them first. A job of the DAG learns of them by
the environment variable ``MTCSIRL_EXTENSIONS``, which the Snakefile sets, since its command line names what they add.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from importlib.machinery import SourceFileLoader
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from types import CodeType
from typing import Any

from mtcsirl import names
from mtcsirl.errors import UserError
from mtcsirl.extensions.checks import attempted, check_name, check_reward, must, shown
from mtcsirl.rewards.ground_truth import COMMON_SENSE_REWARDS

VARIABLE = "MTCSIRL_EXTENSIONS"
MODULE_PREFIX = "mtcsirl_extension_"

Builder = Callable[[Any], Any]
"""From a ``Setup`` to a ``Method``; both are of ``irl``, which stands above this module."""

BUILDERS: dict[str, Builder] = {}
"""What builds the methods of the package, by name."""


def _of_the_package(name: str) -> Builder:
    def build(setup: Any) -> Any:
        if name not in BUILDERS:
            raise RuntimeError("take METHODS from mtcsirl.irl.methods, which can build them")
        return BUILDERS[name](setup)

    return build


METHODS: dict[str, Builder] = {name: _of_the_package(name) for name in names.METHODS}
"""Every method by name, and what builds it."""

_REGISTRIES: Mapping[str, dict[str, Any]] = {"METHODS": METHODS, "COMMON_SENSE_REWARDS": COMMON_SENSE_REWARDS}
_Entries = Mapping[str, Mapping[str, Any]]


@dataclass(frozen=True)
class Extension:
    """A file that was run, and the names that it added."""

    file: str
    """As the user wrote it."""
    methods: frozenset[str]
    cs_rewards: frozenset[str]


LOADED: dict[Path, Extension] = {}
"""Every extension of this process, by the absolute path of its file."""

_PROBES: list[Callable[[Builder], None]] = []


class _FromSource(SourceFileLoader):
    """Runs the file as it is now: Python's cache takes an edit of the same second and size for none."""

    def get_code(self, fullname: str) -> CodeType:
        return self.source_to_code(self.get_data(self.path), self.path)


def load_extensions(files: Iterable[str | Path]) -> None:
    """Run each file once per process; it adds to ``METHODS`` or ``COMMON_SENSE_REWARDS``.

    Raises:
        UserError: a file is missing, fails or ends the program; an entry of it is none, or takes another's name. The
            registries are then as they were before that file.
    """
    for file in files:
        path = _path_of(str(file))
        if path not in LOADED:
            with _undone_on_failure(_module_name(path)) as (module_name, before):
                _execute(str(file), path, module_name)
                LOADED[path] = _registered(str(file), before)


def load_from_environment() -> None:
    """Load what the environment variable lists."""
    load_extensions(file for file in os.environ.get(VARIABLE, "").split(os.pathsep) if file)


def probe_methods_with(probe: Callable[[Builder], None]) -> None:
    """Hold the methods of all extensions against ``probe``, of those loaded and of those to come.

    Raises:
        UserError: a method that is loaded already does not pass.
    """
    _PROBES.append(probe)
    for extension in LOADED.values():
        for name in sorted(extension.methods):
            with _named(extension.file, "METHODS", name):
                probe(METHODS[name])


def _path_of(file: str) -> Path:
    if os.pathsep in file:
        raise UserError(f"extensions: {file}: must not hold {os.pathsep!r}, which separates files in {VARIABLE}")
    path = Path(os.path.realpath(file))
    if path.is_dir():
        raise UserError(f"extensions: {file}: is a folder; name a Python file")
    if not path.is_file():
        raise UserError(f"extensions: {file}: no such file")
    if not file.endswith(".py"):
        raise UserError(f"extensions: {file}: must end in .py")
    return path


def _module_name(path: Path) -> str:
    """The name of its file behind a prefix, with a number where a file of another folder has that name."""
    name, number = f"{MODULE_PREFIX}{path.stem}", 1
    while name in sys.modules:
        number += 1
        name = f"{MODULE_PREFIX}{path.stem}_{number}"
    return name


@contextmanager
def _undone_on_failure(module_name: str) -> Iterator[tuple[str, _Entries]]:
    before = {kind: dict(registry) for kind, registry in _REGISTRIES.items()}
    try:
        yield module_name, before
    except BaseException:
        sys.modules.pop(module_name, None)
        for kind, entries in before.items():
            _REGISTRIES[kind].clear()
            _REGISTRIES[kind].update(entries)
        raise


def _execute(file: str, path: Path, module_name: str) -> None:
    spec = spec_from_file_location(module_name, path, loader=_FromSource(module_name, str(path)))
    assert spec is not None
    module = module_from_spec(spec)
    sys.modules[module_name] = module  # a dataclass looks for its module there
    with attempted(f"extensions: {file}"):
        module.__spec__.loader.exec_module(module)  # type: ignore[union-attr]


def _registered(file: str, before: _Entries) -> Extension:
    """What has come to the registries since ``before``, each entry held against what it should be."""
    added = {}
    for kind, registry in _REGISTRIES.items():
        gone = sorted(before[kind].keys() - registry.keys(), key=str)
        if gone:
            raise UserError(f"extensions: {file}: {kind}: takes {gone[0]!r} away; an extension only adds")
        new = [name for name, entry in registry.items() if name not in before[kind] or before[kind][name] is not entry]
        for name in new:
            with _named(file, kind, name):
                _check(kind, name, registry[name], again=name in before[kind])
        added[kind] = frozenset(new)
    return Extension(file, added["METHODS"], added["COMMON_SENSE_REWARDS"])


@contextmanager
def _named(file: str, kind: str, name: Any) -> Iterator[None]:
    try:
        yield
    except UserError as error:
        raise UserError(f"extensions: {file}: {kind}[{name!r}]: {error}") from error


def _check(kind: str, name: Any, entry: Any, *, again: bool) -> None:
    owner = _owner(kind, name) if again else None
    if owner is not None:
        raise UserError(f"is registered by {owner} already; give yours a name of its own, or list one file only")
    check_name(kind, name)
    if kind == "COMMON_SENSE_REWARDS":
        check_reward(name, entry)
        return
    must(callable(entry), f"is {shown(entry)}", "a function from a Setup to a Method")
    for probe in _PROBES:
        probe(entry)


def _owner(kind: str, name: str) -> str | None:
    """The file that has registered ``name``; None where it was a script that calls this package."""
    if kind == "METHODS" and name in names.METHODS:
        return f"mtcsirl/irl/methods/{name}.py, the package's own,"
    if kind == "COMMON_SENSE_REWARDS" and name in names.CS_REWARDS:
        return "mtcsirl/rewards/ground_truth.py, the package's own,"
    owns = (e.file for e in LOADED.values() if name in (e.methods if kind == "METHODS" else e.cs_rewards))
    return next(owns, None)
