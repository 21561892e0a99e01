"""Syntax trees are written in one form, whichever Python parsed them: the identity of a run does not depend on it."""

import ast
import sys
from pathlib import Path

import pytest

from mtcsirl.files import definitions
from mtcsirl.files.definitions import file_hash, written

SOURCE = """from math import pi as circle

@staticmethod
def area(radius, /, *, scale=1.0, **others):
    match others:
        case {"unit": str(unit)}:
            return f"{circle * radius**2:.2f} {unit!r}"
        case _:
            return [*others, None, ...] and {**others, "a": -1j} or area
class Empty:
    pass
"""
HASH = "9c31abda4ab6"
"""Of SOURCE, by Python 3.11, 3.12, 3.13 and 3.14."""


def test_a_source_has_the_same_hash_on_every_python(tmp_path: Path) -> None:
    file = tmp_path / "source.py"
    file.write_text(SOURCE, encoding="utf-8")
    assert file_hash(file) == HASH
    file.write_text(SOURCE.replace("1.0", "2.0"), encoding="utf-8")
    assert file_hash(file) != HASH


@pytest.mark.skipif(sys.version_info >= (3, 12), reason="a later Python's ast.dump has another form")
def test_the_form_is_that_of_python_3_11() -> None:
    files = [*definitions.PACKAGE.rglob("*.py"), *Path(ast.__file__).parent.glob("[a-d]*.py")]
    assert len(files) > 100
    for file in files:
        tree = ast.parse(file.read_bytes())
        assert written(tree) == ast.dump(tree), file


def test_a_field_of_a_later_python_is_written_if_it_holds_anything() -> None:
    class Later(ast.FunctionDef):
        _fields = (*ast.FunctionDef._fields[:1], "type_params")

    def tree(parameters: list[ast.AST]) -> str:
        node = Later("f")
        node.type_params = parameters  # type: ignore[attr-defined, unused-ignore]
        return written(node)

    assert tree([]) == "Later(name='f')"
    assert tree([ast.Name("T")]) == "Later(name='f', type_params=[Name(id='T')])"
