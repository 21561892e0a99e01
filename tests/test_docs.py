"""The documents say what is there: names in the code, files behind links, targets with their costs."""

import re
from functools import cache
from pathlib import Path

import pytest

from mtcsirl.settings import Settings
from mtcsirl.study.design import ARTEFACTS, design
from mtcsirl.study.plan import load_rates, plan
from tests.conftest import CHECKOUT

SOURCE = CHECKOUT / "src" / "mtcsirl"
DOCUMENTS = [CHECKOUT / "README.md", *sorted((CHECKOUT / "docs").glob("*.md"))]


@cache
def words(file: Path) -> frozenset[str]:
    return frozenset(re.findall(r"\w+", file.read_text(encoding="utf-8")))


def references() -> list[tuple[str, str]]:
    """(file, name) wherever the methods page has ``file.py: name``; a name may be ``Class.method``."""
    text = (CHECKOUT / "docs" / "methods.md").read_text(encoding="utf-8")
    of_the_trainer = [("irl/trainer.py", name) for name in re.findall(r"`(IrlTrainer\.\w+)`", text)]
    return sorted({*re.findall(r"`([\w/]+\.py): ([\w.]+)`", text), *of_the_trainer})


@pytest.mark.parametrize(("file", "name"), references())
def test_methods_name_what_the_code_defines(file, name):
    text = (SOURCE / file).read_text(encoding="utf-8")
    for part in name.split("."):
        assert re.search(rf"\b(class|def) {part}\b|\b{part} *[=:]", text), f"{file} defines no {part}"


def test_methods_name_every_equation_and_artefact():
    text = (CHECKOUT / "docs" / "methods.md").read_text(encoding="utf-8")
    for number in range(1, 12):
        assert re.search(rf"^\| eq\. [\d, ]*\b{number}\b", text, re.MULTILINE), f"equation {number}"
    files = {file for file, _ in references()}
    assert {"claims/claims.py", "results/rows.py", "rewards/curriculum.py", "irl/losses.py"} <= files


def test_statistics_of_the_methods_page_exist():
    text = (CHECKOUT / "docs" / "methods.md").read_text(encoding="utf-8").split("## Statistics")[1]
    named = set(re.findall(r"\| `(\w+)` \|$", text, re.MULTILINE))
    assert len(named) == 10
    assert named <= words(SOURCE / "results" / "statistics.py")


@pytest.mark.parametrize("document", DOCUMENTS, ids=lambda path: path.name)
def test_links_between_documents_lead_somewhere(document):
    links = re.findall(r"\]\(([^)#\s]+)[^)]*\)", document.read_text(encoding="utf-8"))
    for link in links:
        if not re.match(r"[a-z]+:", link):
            assert (document.parent / link).exists(), link


def costs() -> dict[str, tuple[int, float]]:
    """Target -> (runs, core-hours) as the README prints them."""
    text = (CHECKOUT / "README.md").read_text(encoding="utf-8")
    rows = re.findall(r"^\| `snakemake --cores 2 (\w+)` \|.*\| ([\d,]+) \| ([\d.,]+) \|", text, re.MULTILINE)
    return {name: (int(runs.replace(",", "")), float(hours.replace(",", ""))) for name, runs, hours in rows}


def test_readme_gives_every_target():
    assert set(costs()) == {*ARTEFACTS, "claims", "report"}


@pytest.mark.parametrize("name", [*ARTEFACTS, "report"])
def test_readme_gives_the_planned_cost(name):
    """Within a fifth and half an hour: a small change of the settings is no reason to edit the README."""
    settings = Settings()
    stages = plan(design(settings, name if name in ARTEFACTS else None), settings, load_rates())
    jobs, core_hours = sum(stage.jobs for stage in stages), sum(stage.core_hours for stage in stages)
    runs, hours = costs()[name]
    today = f"{name}: {jobs} runs, {core_hours:.1f} core-hours by today's `mtcsirl plan`"
    assert runs == jobs, today
    assert hours == pytest.approx(core_hours, rel=0.2, abs=0.5), today
