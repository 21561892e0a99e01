"""Which modules decide a result: what a rule lists as input, so that an edit reruns the jobs it concerns and no others.

Starting from the modules that a stage calls, the imports are followed through the package. Glue is left out: settings
reach a job as its parameters, and how a file is written does not change what is in it.
"""

import ast
from collections.abc import Iterable, Iterator
from functools import cache
from pathlib import Path

PACKAGE = Path(__file__).parents[1]
GLUE = (
    "settings/",
    "errors.py",
    "extensions.py",
    "names.py",
    "files/storage.py",
    "files/provenance.py",
    "study/",
    "worlds/rendering.py",
    "irl/methods/__init__.py",
)

ROOTS: dict[str, tuple[str, ...]] = {
    "train_expert": ("agents/training.py", "rewards/mixture.py", "rewards/ground_truth.py"),
    "train_sac": ("agents/training.py",),
    "collect_demonstrations": ("episodes/demonstrations.py", "episodes/gates.py"),
    "learn_reward": ("irl/run.py",),
    "transfer": ("agents/training.py", "rewards/learned.py"),
    "score_reward": ("stages/scoring.py",),
    "claims": ("claims/claims.py", "figures/claims.py", "results/rows.py"),
    "report": ("report/collect.py", "report/page.py"),
}
"""The modules that each stage calls. A method and an artefact add their own file."""


def sources(*roots: str) -> tuple[str, ...]:
    """Modules that ``roots`` (files or stages of ``ROOTS``) consist of, as paths below the package; sorted.

    Raises ValueError for a root that does not exist.
    """
    files = [file for root in roots for file in ROOTS.get(root, (root,))]
    missing = [file for file in files if not (PACKAGE / file).is_file()]
    if missing:
        raise ValueError(f"no such module: {', '.join(missing)}")
    return tuple(sorted(_reachable(files)))


def _reachable(files: Iterable[str]) -> set[str]:
    found: set[str] = set()
    left = list(files)
    while left:
        file = left.pop()
        if file not in found:
            found.add(file)
            left.extend(other for other in _imported(file) if not other.startswith(GLUE))
    return found


@cache
def _imported(file: str) -> tuple[str, ...]:
    """The package's modules that ``file`` imports, anywhere in it."""
    tree = ast.parse((PACKAGE / file).read_text(encoding="utf-8"))
    return tuple(path for node in ast.walk(tree) for name in _names(node) if (path := _path(name)) is not None)


def _names(node: ast.AST) -> Iterator[str]:
    """Dotted names that an import statement may mean: ``from a import b`` is a.b if that is a module, and a."""
    if isinstance(node, ast.Import):
        yield from (alias.name for alias in node.names)
    elif isinstance(node, ast.ImportFrom) and node.module and not node.level:
        yield node.module
        yield from (f"{node.module}.{alias.name}" for alias in node.names)


def _path(name: str) -> str | None:
    package, _, rest = name.partition(".")
    if package != "mtcsirl" or not rest:
        return None
    stem = rest.replace(".", "/")
    return next((path for path in (f"{stem}.py", f"{stem}/__init__.py") if (PACKAGE / path).is_file()), None)
