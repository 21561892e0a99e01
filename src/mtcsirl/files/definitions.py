"""The definitions of the package as syntax trees: what stands in a module, what each refers to, and its hash.

A hash is that of the tree without comments, docstrings, annotations, imports and the words of raised errors; what it
refers to is written by bare name, whatever module it stands in. So a better name for a file, a function moved to
another module, another way to import it or a new comment change no hash; a constant, a default and an operation do.
Nor does another version of Python: `ast.dump` has a form of its own in each, so trees are written here.
"""

from __future__ import annotations

import ast
import hashlib
from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from pathlib import Path

PACKAGE = Path(__file__).resolve().parents[1]
NAME = PACKAGE.name

_Scope = ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef
_HOLDS_STATEMENTS = ast.stmt | ast.excepthandler | ast.match_case


@dataclass(frozen=True)
class Definition:
    """A function, class or constant at the top of a module."""

    module: str
    """Dotted, below the package: ``agents.sac``."""
    name: str

    def __str__(self) -> str:
        """Dotted."""
        return f"{self.module}.{self.name}"


@dataclass(frozen=True)
class Module:
    """A parsed module: its definitions and what the names in it mean."""

    name: str
    definitions: dict[str, ast.stmt]
    imported: dict[str, str]
    """Local name -> dotted target below the package, of imports anywhere in the module."""

    def mean(self, name: str) -> Definition | str | None:
        """What ``name`` means here: a definition, a module (its dotted name), or nothing of this package."""
        if name in self.definitions:
            return Definition(self.name, name)
        return resolve(self.imported[name]) if name in self.imported else None


def path_of(module: str) -> Path | None:
    """The file of a module, None if there is no such module."""
    stem = PACKAGE / module.replace(".", "/") if module else PACKAGE
    return next((path for path in (stem.with_suffix(".py"), stem / "__init__.py") if path.is_file()), None)


@cache
def load(module: str) -> Module:
    """Parse a module of the package."""
    path = path_of(module)
    if path is None:
        raise ValueError(f"no such module: {NAME}.{module}")
    return _parsed(path, module)


def _parsed(path: Path, name: str) -> Module:
    tree = ast.parse(path.read_text(encoding="utf-8"))
    return Module(name, dict(_defined(tree.body)), dict(_imports(tree)))


def _defined(body: list[ast.stmt]) -> Iterator[tuple[str, ast.stmt]]:
    for node in body:
        if isinstance(node, _Scope):
            yield node.name, node
        elif isinstance(node, ast.Assign | ast.AnnAssign | ast.AugAssign):
            targets = node.targets if isinstance(node, ast.Assign) else [node.target]
            for target in targets:
                yield from ((part.id, node) for part in ast.walk(target) if isinstance(part, ast.Name))
        elif isinstance(node, ast.If | ast.Try | ast.With):
            yield from _defined([child for child in ast.iter_child_nodes(node) if isinstance(child, ast.stmt)])


def _imports(tree: ast.AST) -> Iterator[tuple[str, str]]:
    """Local name and dotted target below the package of every import of it."""
    left = deque([tree])
    while left:  # breadth first, through statements alone: ten times as many nodes are expressions
        node = left.popleft()
        left += [child for child in ast.iter_child_nodes(node) if isinstance(child, _HOLDS_STATEMENTS)]
        if isinstance(node, ast.ImportFrom) and node.module and not node.level:
            package, _, rest = node.module.partition(".")
            if package == NAME:
                for alias in node.names:
                    yield alias.asname or alias.name, f"{rest}.{alias.name}".lstrip(".")


@cache
def resolve(dotted: str) -> Definition | str | None:
    """What a dotted name below the package is: a module, or the definition at the end of re-exports."""
    if path_of(dotted) is not None:
        return dotted
    module, _, name = dotted.rpartition(".")
    if path_of(module) is None:
        return None
    return load(module).mean(name)


class _Canonical(ast.NodeTransformer):
    """Leaves out what cannot change a result and names the package's definitions alike, however imported."""

    def __init__(self, module: Module) -> None:
        self._module = module
        self.found: set[Definition] = set()
        self.data: set[str] = set()
        """Data files that are read, as paths below the package."""

    def visit_Import(self, node: ast.Import) -> None:
        return None

    def visit_ImportFrom(self, node: ast.ImportFrom) -> None:
        return None

    def visit_Expr(self, node: ast.Expr) -> ast.AST | None:
        if isinstance(node.value, ast.Constant) and isinstance(node.value.value, str):
            return None
        return self.generic_visit(node)

    def visit_arg(self, node: ast.arg) -> ast.AST:
        node.annotation = None
        return node

    def visit_AnnAssign(self, node: ast.AnnAssign) -> ast.AST:
        node.annotation = ast.Constant(None)
        return self.generic_visit(node)

    def visit_FunctionDef(self, node: ast.FunctionDef) -> ast.AST:
        node.returns = None
        return self.generic_visit(node)

    def visit_Raise(self, node: ast.Raise) -> ast.AST:
        if isinstance(node.exc, ast.Call):
            node.exc.args, node.exc.keywords = [], []
        return self.generic_visit(node)

    def visit_Name(self, node: ast.Name) -> ast.AST:
        return self._named(self._module.mean(node.id), node)

    def visit_Attribute(self, node: ast.Attribute) -> ast.AST:
        dotted = self._dotted(node)
        return self.generic_visit(node) if dotted is None else self._named(resolve(dotted), node)

    def visit_Call(self, node: ast.Call) -> ast.AST:
        self.data |= set(_data_file(node))
        return self.generic_visit(node)

    def _named(self, meaning: Definition | str | None, node: ast.AST) -> ast.AST:
        if isinstance(meaning, Definition):
            self.found.add(meaning)
            return ast.Name(meaning.name, ast.Load())
        return node

    def _dotted(self, node: ast.Attribute) -> str | None:
        """The dotted target of module.name, None for attributes of anything else."""
        if isinstance(node.value, ast.Name):
            meaning = self._module.mean(node.value.id)
            return f"{meaning}.{node.attr}" if isinstance(meaning, str) else None
        return None


def _data_file(node: ast.Call) -> Iterator[str]:
    """``resources.files("package.folder").joinpath("name")`` reads a data file."""
    function = node.func
    if isinstance(function, ast.Attribute) and function.attr == "joinpath" and isinstance(function.value, ast.Call):
        arguments = [*function.value.args, *node.args]
        match [part.value for part in arguments if isinstance(part, ast.Constant)]:
            case [str(package), str(name)] if package.partition(".")[0] == NAME:
                folder = package.partition(".")[2].replace(".", "/")
                yield f"{folder}/{name}".lstrip("/")


@cache
def examine(definition: Definition) -> tuple[str, frozenset[Definition], frozenset[str]]:
    """The hash of a definition, the definitions that it refers to and the data files that it reads."""
    digest, found, data = _examine(definition.module, load(definition.module).definitions[definition.name])
    return digest, found - {definition}, data


@cache
def _examine(module: str, node: ast.stmt) -> tuple[str, frozenset[Definition], frozenset[str]]:
    """Of a statement, which may define several names; once, since the tree becomes its canonical form."""
    canonical = _Canonical(load(module))
    tree = canonical.visit(node)
    for part in ast.walk(tree):
        if isinstance(part, _Scope | ast.With | ast.If | ast.For | ast.While | ast.Try) and not part.body:
            part.body = [ast.Pass()]
    digest = hashlib.sha256(written(tree).encode()).hexdigest()[:12]
    return digest, frozenset(canonical.found), frozenset(canonical.data)


def written(tree: object) -> str:
    """A tree as Python 3.11's `ast.dump` writes it; 3.12 adds `type_params`, 3.13 leaves out empty lists."""
    if isinstance(tree, list):
        return f"[{', '.join(map(written, tree))}]"
    if not isinstance(tree, ast.AST):
        return repr(tree)
    fields = {name: getattr(tree, name) for name in tree._fields if hasattr(tree, name)}
    told = {name: value for name, value in fields.items() if not _untold(tree, name, value)}
    return f"{type(tree).__name__}({', '.join(f'{name}={written(value)}' for name, value in told.items())})"


def _untold(node: ast.AST, name: str, value: object) -> bool:
    """Whether 3.11 does not write a field: one that is left out in the code, or that it does not know yet."""
    return (value is None and getattr(type(node), name, ...) is None) or (name == "type_params" and not value)


def file_hash(path: Path) -> str:
    """The hash of a whole Python file outside of the package, comments and docstrings left out.

    What it imports from elsewhere counts, under which name and in which order whatsoever: in the tree of a module of
    the package the names of definitions stand for that, here nothing else does.
    """
    text = path.read_text(encoding="utf-8")
    tree = _Canonical(_parsed(path, "")).visit(ast.parse(text))
    imported = sorted(set(_imported_elsewhere(ast.parse(text))))
    return hashlib.sha256("\n".join([written(tree), *imported]).encode()).hexdigest()[:12]


def _imported_elsewhere(tree: ast.AST) -> Iterator[str]:
    """``dotted name as local name`` of every import but those of the package, whose names the tree resolves."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from (f"{alias.name} as {alias.asname}" for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            source = "." * node.level + (node.module or "")
            if source.partition(".")[0] != NAME:
                yield from (f"{source}.{alias.name} as {alias.asname or alias.name}" for alias in node.names)
