"""The house: rooms in one order, imports that point one way, no circles, short files; read from the syntax alone.

An import counts wherever it stands: below ``TYPE_CHECKING``, inside a function, or as the literal start of an
``import_module(f"mtcsirl.rooms...")``.
"""

import ast
from collections.abc import Iterable, Mapping
from pathlib import Path

import pytest

from tests.conftest import CHECKOUT

PACKAGE = CHECKOUT / "src" / "mtcsirl"
_ROOMS = """names errors transitions slurm files worlds rewards extensions settings episodes agents irl study results
stages claims tables figures report validation calibration exports commands cli"""
ROOMS = tuple(_ROOMS.split())
"""Packages and modules below ``mtcsirl``; each may import the ones before it."""
LONGEST = 300
SAYS_NOTHING = {"utils", "util", "helpers", "misc", "common"}
"""Names for a module that say nothing about what is in it."""

OFFENDERS: set[tuple[str, str]] = set()
"""Upward imports that are still there: (file, what it imports). This set may only shrink, and it ends empty."""

Graph = dict[str, set[str]]
"""Module -> the modules that it imports."""


def modules(package: Path) -> dict[str, Path]:
    """Dotted name -> file of every module of ``package``; a package has the name of its folder."""
    found = {}
    for file in sorted(package.rglob("*.py")):
        parts = file.relative_to(package.parent).with_suffix("").parts
        found[".".join(parts[:-1] if parts[-1] == "__init__" else parts)] = file
    return found


def imports(package: Path) -> Graph:
    """Every import between modules of ``package``."""
    files = modules(package)
    graph: Graph = {name: set() for name in files}
    for name, file in files.items():
        holder = name if file.stem == "__init__" else name.rpartition(".")[0]
        for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
            for wanted in _named(node, holder):
                known = _longest_known(wanted, files)
                if known and known != name:
                    graph[name].add(known)
    return graph


def _named(node: ast.AST, holder: str) -> list[str]:
    """The dotted names that ``node`` imports, or none; ``holder`` is the package that relative imports start from."""
    if isinstance(node, ast.Import):
        return [alias.name for alias in node.names]
    if isinstance(node, ast.ImportFrom):
        above = holder.split(".")[: len(holder.split(".")) - node.level + 1] if node.level else []
        start = ".".join([*above, *([node.module] if node.module else [])])
        return [f"{start}.{alias.name}" for alias in node.names]
    if isinstance(node, ast.Call) and node.args and ast.unparse(node.func).endswith("import_module"):
        text = node.args[0].values[0] if isinstance(node.args[0], ast.JoinedStr) else node.args[0]
        return [text.value.rstrip(".")] if isinstance(text, ast.Constant) and isinstance(text.value, str) else []
    return []


def _longest_known(name: str, files: Mapping[str, Path]) -> str:
    """``name`` without the parts that are no modules: ``mtcsirl.names.TASKS`` -> ``mtcsirl.names``."""
    while name and name not in files:
        name = name.rpartition(".")[0]
    return name


def room(module: str) -> str:
    """The second part of a dotted name; of the package itself: nothing."""
    return module.split(".")[1] if "." in module else ""


def upward(graph: Graph, rooms: Iterable[str]) -> set[tuple[str, str]]:
    """Imports of a room that comes later than the importer's."""
    order = {name: index for index, name in enumerate(rooms)}
    arrows = ((name, other) for name, others in graph.items() for other in others if room(name) and room(other))
    return {(name, other) for name, other in arrows if order[room(name)] < order[room(other)]}


def circles(graph: Mapping[str, set[str]]) -> list[tuple[str, ...]]:
    """Groups of nodes that reach each other, each sorted."""
    reach = {name: _reachable(graph, name) for name in graph}
    groups = {tuple(sorted({name, *(o for o in reach[name] if name in reach.get(o, ()))})) for name in graph}
    return sorted(group for group in groups if len(group) > 1)


def _reachable(graph: Mapping[str, set[str]], start: str) -> set[str]:
    seen: set[str] = set()
    waiting = [start]
    while waiting:
        for name in graph.get(waiting.pop(), set()) - seen:
            seen.add(name)
            waiting.append(name)
    return seen


def pairs(graph: Graph) -> set[tuple[str, str]]:
    """Rooms that import each other, (earlier name, later name)."""
    arrows = {(room(name), room(other)) for name, others in graph.items() for other in others}
    return {(a, b) for a, b in arrows if a < b and (b, a) in arrows and a and b}


def too_long(package: Path) -> list[str]:
    """Files of more than ``LONGEST`` lines."""
    lengths = {file: len(file.read_text(encoding="utf-8").splitlines()) for file in modules(package).values()}
    return [f"{file.relative_to(package)}: {length}" for file, length in lengths.items() if length > LONGEST]


def nameless(package: Path) -> list[str]:
    """Modules and folders whose name says nothing."""
    return [name for name in modules(package) if SAYS_NOTHING & set(name.split("."))]


@pytest.fixture(scope="module")
def graph() -> Graph:
    return imports(PACKAGE)


def test_every_room_has_its_place(graph):
    assert {room(name) for name in graph} - {""} == set(ROOMS)


def test_no_new_import_points_upward(graph):
    assert upward(graph, ROOMS) - OFFENDERS == set(), "move what is shared to the earlier of the two rooms"


def test_known_offenders_are_still_there(graph):
    assert OFFENDERS - upward(graph, ROOMS) == set(), "mended: take it out of OFFENDERS"


def test_no_circle_of_files(graph):
    kept = {name: {other for other in others if (name, other) not in OFFENDERS} for name, others in graph.items()}
    assert circles(kept) == []


def test_no_two_rooms_import_each_other(graph):
    kept = {name: {other for other in others if (name, other) not in OFFENDERS} for name, others in graph.items()}
    assert pairs(kept) == set()


def test_no_file_is_too_long():
    assert too_long(PACKAGE) == []


def test_every_name_says_something():
    assert nameless(PACKAGE) == []


# --- siblings: each rule sees the fault that it is there for -------------------------------------------------------


@pytest.fixture
def house(tmp_path):
    """Write a made-up package ``mtcsirl`` of the given files and return its folder."""

    def build(**files: str) -> Path:
        package = tmp_path / "mtcsirl"
        for name, text in {"__init__": "", **files}.items():
            file = package / f"{name.replace('__in__', '/')}.py"
            file.parent.mkdir(parents=True, exist_ok=True)
            file.write_text(text, encoding="utf-8")
        return package

    return build


UPWARD = {
    "plain": "import mtcsirl.late\n",
    "from": "from mtcsirl.late import thing\n",
    "of the package": "from mtcsirl import late\n",
    "relative": "from . import late\n",
    "relative, a name": "from .late import thing\n",
    "for types alone": ("from typing import TYPE_CHECKING\nif TYPE_CHECKING:\n    from mtcsirl.late import Thing\n"),
    "inside a function": "def f():\n    from mtcsirl.late import thing\n    return thing\n",
    "by name": 'from importlib import import_module\nlate = import_module("mtcsirl.late")\n',
    "by a built name": 'import importlib\n\ndef f(n):\n    return importlib.import_module(f"mtcsirl.late.{n}")\n',
}


@pytest.mark.parametrize("text", UPWARD.values(), ids=UPWARD)
def test_an_upward_import_is_seen_wherever_it_stands(house, text):
    package = house(early=text, late="thing = Thing = 1\n")
    assert upward(imports(package), ["early", "late"]) == {("mtcsirl.early", "mtcsirl.late")}
    assert upward(imports(package), ["late", "early"]) == set()


def test_a_circle_of_three_files_is_seen(house):
    package = house(a="import mtcsirl.b\n", b="def f():\n    import mtcsirl.c\n", c="from mtcsirl.a import x\n", d="")
    assert circles(imports(package)) == [("mtcsirl.a", "mtcsirl.b", "mtcsirl.c")]


def test_two_rooms_that_import_each_other_are_seen_without_a_circle_of_files(house):
    package = house(
        **{"a__in____init__": "", "a__in__one": "import mtcsirl.b.two\n", "a__in__three": ""},
        **{"b__in____init__": "", "b__in__two": "", "b__in__four": "from mtcsirl.a.three import x\n"},
    )
    assert circles(imports(package)) == []
    assert pairs(imports(package)) == {("a", "b")}


def test_a_long_file_and_a_name_that_says_nothing_are_seen(house):
    package = house(a="x = 1\n" * (LONGEST + 1), b="x = 1\n" * LONGEST, **{"c__in__utils": ""})
    assert too_long(package) == [f"a.py: {LONGEST + 1}"]
    assert nameless(package) == ["mtcsirl.c.utils"]


def test_text_that_looks_like_an_import_is_none(house):
    package = house(early='"""import mtcsirl.late"""\n# from mtcsirl import late\n', late="")
    assert imports(package)["mtcsirl.early"] == set()
