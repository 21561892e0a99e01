"""The files of a user's own that an extension consists of: its own, and those that it imports, and so on.

What is installed does not count: its versions stand in the provenance of a run. Nor do files that are no modules.
"""

import ast
import sys
import sysconfig
from collections.abc import Iterator
from functools import cache
from importlib.machinery import PathFinder
from importlib.util import resolve_name
from pathlib import Path

from mtcsirl.files.definitions import PACKAGE, file_hash
from mtcsirl.files.identity import checksum

_PACKAGES = ("site-packages", "dist-packages")


@cache
def own_files(extension: Path) -> tuple[tuple[str, str], ...]:
    """Name and hash of each file, as they were when this process first asked."""
    found: set[Path] = set()
    left = [(extension, "")]
    while left:
        path, package = left.pop()
        if path in found:
            continue
        found.add(path)
        for name in _imported(path, package):
            file = _file_of(name)
            if file is not None:
                left.append((file, name if file.stem == "__init__" else name.rpartition(".")[0]))
    return tuple(sorted((_shown(path), _hash(path)) for path in found))


def _imported(path: Path, package: str) -> Iterator[str]:
    """Dotted names of everything that a file may import, packages on the way to it among them."""
    tree = ast.parse(path.read_bytes()) if path.suffix == ".py" else ast.Module([], [])
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            for alias in node.names:
                yield from _with_parents(alias.name)
        elif isinstance(node, ast.ImportFrom):
            source = "." * node.level + (node.module or "")
            if node.level and not package:
                continue
            module = resolve_name(source, package) if node.level else source
            yield from _with_parents(module)
            yield from (f"{module}.{alias.name}" for alias in node.names)


def _with_parents(name: str) -> Iterator[str]:
    parts = name.split(".")
    yield from (".".join(parts[:end]) for end in range(1, len(parts) + 1))


def _file_of(name: str) -> Path | None:
    """The file of a module that is the user's own; found without importing it, where nothing has imported it yet."""
    origin = getattr(sys.modules[name], "__file__", None) if name in sys.modules else _origin(name)
    if not isinstance(origin, str):
        return None
    path = Path(origin).resolve()
    return path if path.is_file() and _own(path) else None


def _origin(name: str) -> str | None:
    spec, places = None, None
    for part in _with_parents(name):
        spec = PathFinder.find_spec(part, places)
        if spec is None:
            return None
        places = list(spec.submodule_search_locations or ())
    return None if spec is None else spec.origin


def _own(path: Path) -> bool:
    installed = {Path(sysconfig.get_path(kind)).resolve() for kind in ("stdlib", "platstdlib")} | {PACKAGE}
    return not any(place in path.parents for place in installed) and not set(_PACKAGES) & set(path.parts)


def _shown(path: Path) -> str:
    return f"{path.parent.name}/{path.name}" if path.stem == "__init__" else path.name


def _hash(path: Path) -> str:
    return file_hash(path) if path.suffix == ".py" else checksum(path)[:12]
