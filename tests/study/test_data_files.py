"""Data files are part of what an artefact is made from: another style, template or number makes it stale."""

import ast
import shutil
from collections.abc import Iterator

import pytest

from mtcsirl.files import fingerprint
from mtcsirl.files.definitions import PACKAGE, _data_file
from mtcsirl.study.artefacts import modules_of
from mtcsirl.study.code import artefact_code
from mtcsirl.study.design import ARTEFACTS

STYLE, PUBLISHED = "figures/mtcsirl.mplstyle", "results/published.yaml"
PAGE = ("report/page.html", "report/rows.html", "report/page.css", "report/page.js")


def data_of(name: str) -> set[str]:
    """The data files in the code of an artefact."""
    return {part for part in artefact_code(*modules_of(name)) if "/" in part}


def test_report_is_made_from_its_template_style_and_script():
    assert data_of("report") == set(PAGE)
    assert set(PAGE) <= set(artefact_code("report.collect", "report.page"))


def test_claims_are_made_from_criteria_published_numbers_and_style():
    assert data_of("claims") == {"claims/claims.yaml", PUBLISHED, STYLE}


@pytest.mark.parametrize("name", ARTEFACTS)
def test_figures_are_made_from_their_style_and_tables_from_published_numbers(name):
    assert (STYLE if name.startswith("figure_") else PUBLISHED) in data_of(name)


def unseen(source: str) -> list[str]:
    """Reads of package data whose file the identity of an artefact cannot know."""
    return list(_unseen(ast.parse(source)))


def _unseen(tree: ast.AST) -> Iterator[str]:
    for node in ast.walk(tree):
        if isinstance(node, ast.Call) and ast.unparse(node.func) == "resources.files":
            parents = [call for call in ast.walk(tree) if isinstance(call, ast.Call) and node in ast.walk(call.func)]
            if not any(list(_data_file(call)) for call in parents):
                yield ast.unparse(node)


def test_every_read_of_package_data_names_its_file():
    files = sorted(PACKAGE.rglob("*.py"))
    assert {file.name: found for file in files if (found := unseen(file.read_text(encoding="utf-8")))} == {}


def test_a_file_behind_a_variable_is_seen():
    constant = 'resources.files("mtcsirl.report").joinpath("page.css").read_text()'
    assert unseen(constant) == []
    assert unseen(constant.replace('"page.css"', "name")) == ["resources.files('mtcsirl.report')"]
    assert unseen("place = resources.files('mtcsirl.report')") == ["resources.files('mtcsirl.report')"]


@pytest.mark.parametrize("file", PAGE)
def test_another_byte_of_the_page_is_another_code(file, tmp_path, monkeypatch):
    for name in PAGE:
        (tmp_path / name).parent.mkdir(exist_ok=True)
        shutil.copy(PACKAGE / name, tmp_path / name)
    monkeypatch.setattr(fingerprint, "PACKAGE", tmp_path)
    fingerprint._data_hash.cache_clear()
    before = fingerprint.code.__wrapped__(("report.page",))
    (tmp_path / file).write_text((tmp_path / file).read_text(encoding="utf-8") + "\n", encoding="utf-8")
    fingerprint._data_hash.cache_clear()
    after = fingerprint.code.__wrapped__(("report.page",))
    fingerprint._data_hash.cache_clear()
    assert {name for name in after if after[name] != before[name]} == {file}
