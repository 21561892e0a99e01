"""The site of docs/: builds without a warning, needs no network, can be searched, draws formulas and the DAG."""

import html
import json
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from website.diagram import drawing, parsed, rows, shortest
from website.formulas import mathml, with_formulas

from tests.conftest import CHECKOUT
from tests.report.browser import CHROMIUM

READ = ("docs", "website", "src", "examples", "mkdocs.yml", "README.md", "CONTRIBUTING.md", "CHANGELOG.md")
READ += ("LICENSE", "CITATION.cff", "benchmarks/results.json", "benchmarks/results.png")
READ += tuple(f"paper_figs/{file.name}" for file in (CHECKOUT / "paper_figs").glob("figure_*.png"))
READ += ("results/reference/claims/claims.png", *(f"results/reference/tables/table_{n}.md" for n in range(1, 6)))
needs_chromium = pytest.mark.skipif(CHROMIUM is None, reason="chromium is not installed: apt-get install chromium")


def build(source: Path) -> subprocess.CompletedProcess[str]:
    environment = os.environ | {"NO_MKDOCS_2_WARNING": "1", "PYTHONDONTWRITEBYTECODE": "1"}
    command = [sys.executable, "-m", "mkdocs", "build"]
    return subprocess.run(command, cwd=source, env=environment, capture_output=True, text=True, check=False)


@pytest.fixture(scope="module")
def source(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A copy of all that the site is made from, so that tests may break it."""
    folder = tmp_path_factory.mktemp("source")
    for name in READ:
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        if (CHECKOUT / name).is_dir():
            shutil.copytree(CHECKOUT / name, folder / name, ignore=shutil.ignore_patterns("__pycache__"))
        else:
            shutil.copy(CHECKOUT / name, folder / name)
    return folder


@pytest.fixture(scope="module")
def site(source: Path) -> Path:
    done = build(source)
    assert done.returncode == 0, done.stderr
    assert "WARNING" not in done.stderr
    return source / "build" / "site"


def pages(site: Path) -> dict[str, str]:
    """Address and text of each page; 404.html is for a server, whose root it starts from."""
    files = [file for file in site.rglob("*.html") if file.name != "404.html"]
    return {file.relative_to(site).as_posix(): file.read_text(encoding="utf-8") for file in files}


@pytest.mark.slow
def test_every_document_is_a_page(site):
    documents = {file.relative_to(CHECKOUT / "docs") for file in (CHECKOUT / "docs").rglob("*.md")}
    names = {(f.parent / "index" if f.stem == "README" else f.with_suffix("")).as_posix() for f in documents}
    assert names <= {name.removesuffix(".html") for name in pages(site)}


@pytest.mark.slow
def test_the_browser_is_sent_nowhere(site):
    """Links for the reader may lead outside; nothing that a page loads does."""
    for name, text in pages(site).items():
        loaded = re.findall(r"<(?:script|img|iframe|source)[^>]*\bsrc=\"?([^\" >]+)", text)
        loaded += re.findall(r"<link[^>]*\bhref=\"?([^\" >]+)", text)
        assert loaded
        for address in loaded:
            assert not re.match(r"(https?:)?//", address), f"{name}: {address}"
            if not address.startswith("data:"):
                assert (site / name).parent.joinpath(address.partition("?")[0]).exists(), f"{name}: {address}"


@pytest.mark.slow
def test_scripts_from_a_network_are_not_asked_for(site):
    """The theme would fetch Mermaid for a block of that class; ours are drawn already."""
    assert not [name for name, text in pages(site).items() if 'class="mermaid"' in text]
    assert 'class="arrow"' in pages(site)["design.html"]


@pytest.mark.slow
def test_equations_are_drawn(site):
    methods = pages(site)["methods.html"]
    assert methods.count("<math ") > 20
    assert not [name for name, text in pages(site).items() if "arithmatex" in text]


@pytest.mark.slow
def test_the_api_has_signatures_and_texts(site):
    page = html.unescape(re.sub(r"<[^>]+>", "", pages(site)["api/environments.html"]))
    assert re.search(r"with_learned_reward\(", page)
    assert "The fast Meta-World as gymnasium environments" in page


@pytest.mark.slow
def test_the_search_knows_every_page(site):
    index = json.loads((site / "search" / "search_index.json").read_text(encoding="utf-8"))
    found = {entry["location"].partition("#")[0] for entry in index["docs"]}
    assert {"start.html", "methods.html", "api/environments.html", "checkout/CHANGELOG.html"} <= found


@needs_chromium
@pytest.mark.slow
def test_a_site_in_a_folder_can_be_searched(site, tmp_path):
    """Without a server: the address asks for a word, and the page shows where it is."""
    command = [CHROMIUM, "--headless", "--no-sandbox", "--disable-gpu", f"--user-data-dir={tmp_path}"]
    command += ["--virtual-time-budget=20000", "--dump-dom", f"{(site / 'index.html').as_uri()}?q=Fieller"]
    shown = subprocess.run(command, capture_output=True, text=True, timeout=120, check=True).stdout
    links = re.findall(r'<a [^>]*class="md-search-result__link"[^>]*>', shown)
    assert any("methods.html" in link for link in links), links


@pytest.mark.slow
@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        ("[there](nowhere.md)", "nowhere.md"),
        ("[there](methods.md#nowhere)", "#nowhere"),
        ("$$\n\\nocommand{x}\n$$", "is not understood"),
        ("```mermaid\nsequenceDiagram\n```", "is not understood"),
        ("::: mtcsirl.no_such_module", "no_such_module"),
    ],
    ids=["page", "anchor", "formula", "diagram", "module"],
)
def test_a_fault_ends_the_build(source, site, text, complaint):
    page = source / "docs" / "start.md"
    kept = page.read_text(encoding="utf-8")
    try:
        page.write_text(f"{kept}\n{text}\n", encoding="utf-8")
        done = build(source)
        assert done.returncode != 0
        assert complaint in done.stderr
    finally:
        page.write_text(kept, encoding="utf-8")


def test_formulas():
    found = with_formulas(r'<p>a <span class="arithmatex">\(x &lt; \log y\)</span></p>')
    assert found.startswith('<p>a <math alttext="x &lt; \\log y" ')
    assert "<mo>&#x0003C;</mo>" in found
    assert '<mi>log</mi><mspace width="0.17em"/>' in found
    with pytest.raises(ValueError, match=r"nocommand is not understood"):
        mathml(r"\nocommand{x}", "inline")


CHART = "flowchart LR\n  a[the & first] --> b & c --> d\n  a --> d\n"


def test_diagrams():
    labels, arrows = parsed(CHART)
    assert labels == {"a": "the & first", "b": "b", "c": "c", "d": "d"}
    assert arrows == [("a", "b"), ("a", "c"), ("b", "d"), ("c", "d"), ("a", "d")]
    assert rows(labels, arrows) == {"a": 0, "b": 1, "c": 1, "d": 2}
    assert shortest(arrows) == arrows[:-1], "a leads to d by b and by c"
    assert drawing(CHART).count("<rect ") == 4


@pytest.mark.parametrize("chart", ["graph TD\n a --> b\n", "flowchart LR\n a -- b\n", "flowchart LR\n a --> b --> a\n"])
def test_a_diagram_that_is_not_understood_is_an_error(chart):
    with pytest.raises(ValueError, match="diagram: "):
        drawing(chart)
