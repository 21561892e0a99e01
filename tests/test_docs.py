"""The documents say what is there: names in the code, files behind links, targets with their costs."""

import hashlib
import re
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import pytest

from mtcsirl.settings import Settings
from mtcsirl.settings.loading import load
from mtcsirl.study.design import ARTEFACTS, design
from mtcsirl.study.plan import plan
from mtcsirl.study.rates import load_rates
from tests.conftest import CHECKOUT

SOURCE = CHECKOUT / "src" / "mtcsirl"
DOCUMENTS = [*sorted(CHECKOUT.glob("*.md")), *sorted((CHECKOUT / "docs").rglob("*.md"))]
WRITTEN_BY_HAND = [document for document in DOCUMENTS if document.name != "results.md"]


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
    assert len(named) == 16
    files = [SOURCE / "results" / f"{name}.py" for name in ("statistics", "contrasts", "moments")]
    assert named <= frozenset[str]().union(*map(words, [*files, SOURCE / "claims" / "evidence.py"]))


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


STILL_WIDE: dict[str, int] = {}
"""Documents with so many wide lines left; this may only shrink, and it ends empty."""


# --- form: short lines, a short README, interpretations in order ----------------------------------------------------


def too_wide(text: str) -> list[str]:
    """Lines of 120 columns and more; a row of a table may be as wide as it must."""
    return [line for line in text.splitlines() if len(line) >= 120 and not line.lstrip().startswith("|")]


def misnumbered(text: str) -> list[str]:
    """Entries that are not numbered I1, I2, ... in the order in which they stand."""
    found = re.findall(r"^### (I\d+)\. ", text, re.MULTILINE)
    return [
        name for name, right in zip(found, (f"I{number}" for number in range(1, 1000)), strict=False) if name != right
    ]


@pytest.mark.parametrize("document", WRITTEN_BY_HAND, ids=lambda path: path.name)
def test_lines_are_shorter_than_120_columns(document):
    wide = too_wide(document.read_text(encoding="utf-8"))
    assert len(wide) <= STILL_WIDE.get(document.name, 0), wide


def test_a_wide_line_is_seen_and_a_wide_row_is_none():
    assert too_wide(f"{'a' * 119}\n| {'a' * 200} |\n{'b' * 120}") == ["b" * 120]


def test_the_readme_is_short():
    assert len((CHECKOUT / "README.md").read_text(encoding="utf-8").splitlines()) < 120


def interpretations() -> str:
    return (CHECKOUT / "docs" / "interpretations.md").read_text(encoding="utf-8")


def test_interpretations_are_in_order():
    assert "### I1. " in interpretations()
    assert misnumbered(interpretations()) == []


def test_a_gap_between_interpretations_is_seen():
    assert misnumbered("### I1. a\n### I3. b\n") == ["I3"]


def test_every_interpretation_has_its_four_parts():
    for entry in re.split(r"^### (?=I\d)", interpretations(), flags=re.MULTILINE)[1:]:
        name = entry.partition(".")[0]
        parts = [part for part in ("Paper", "Reading", "Alternatives", "Sensitivity") if f"- **{part}" not in entry]
        assert not parts, f"{name} lacks {parts}"
        assert "not yet run" not in entry, f"{name}: untested, and what is expected"


def interpretations_in(text: str) -> set[str]:
    """The interpretations that ``text`` names; ``"I64"`` in quotes is a type of numbers."""
    return set(re.findall(r"(?<![\"'\w])I[1-9]\d?(?![\"'\w])", text))


def test_a_type_of_numbers_is_no_interpretation():
    assert interpretations_in('"I64": torch.int64, see I12 (and I7); BI3 I100') == {"I12", "I7"}


def named() -> Iterator[tuple[Path, str]]:
    """(file, interpretation) wherever code, configuration or a document names one."""
    folders = ("src", "docs", "config", "workflow", "tests", "benchmarks")
    files = [file for folder in folders for file in sorted((CHECKOUT / folder).rglob("*"))]
    for file in [*files, CHECKOUT / "README.md"]:
        if file.suffix in {".py", ".md", ".yaml", ".smk", ".rst"} and file != Path(__file__):
            for name in sorted(interpretations_in(file.read_text(encoding="utf-8"))):
                yield file, name


def test_interpretations_that_are_named_exist():
    known = set(re.findall(r"^### (I\d+)\. ", interpretations(), re.MULTILINE))
    assert [(file.name, name) for file, name in named() if name not in known] == []


# --- the preregistration ---------------------------------------------------------------------------------------------

FROZEN = re.compile(r"^Status: frozen on (\d{4}-\d\d-\d\d) at ([0-9a-f]{7,40})\.$", re.MULTILINE)


def broken_seals(text: str, frozen: dict[str, bytes]) -> list[str]:
    """Rows of the table of checksums (``| name | command | sum |``) that are not the SHA-256 of what is there now."""
    rows = dict(re.findall(r"^\| (\w+) \| .* \| (\S.*?) \|$", text, re.MULTILINE))
    return [name for name, data in frozen.items() if rows.get(name) != hashlib.sha256(data).hexdigest()]


def test_preregistration_holds_what_was_frozen():
    text = (CHECKOUT / "docs" / "preregistration.md").read_text(encoding="utf-8")
    if not FROZEN.search(text):
        assert "Status: not frozen yet." in text, "the status line says either"
        pytest.skip("not frozen yet")
    settings = load().model_dump_json(indent=2) + "\n"  # what `mtcsirl settings json` prints
    criteria = (SOURCE / "claims" / "claims.yaml").read_bytes()
    assert broken_seals(text, {"settings": settings.encode(), "criteria": criteria}) == []


def test_preregistration_has_an_expectation_for_every_claim():
    text = (CHECKOUT / "docs" / "preregistration.md").read_text(encoding="utf-8")
    for number in range(1, 14):
        assert len(re.findall(rf"^\| C{number} \|", text, re.MULTILINE)) == 2, f"C{number}: expected, and why not"


def test_a_changed_byte_breaks_the_seal():
    text = f"| settings | `mtcsirl settings json \\| sha256sum` | {hashlib.sha256(b'a').hexdigest()} |\n"
    assert broken_seals(text, {"settings": b"a"}) == []
    assert broken_seals(text, {"settings": b"b"}) == ["settings"]
    assert broken_seals("| settings | `x` | to be filled in |\n", {"settings": b"a"}) == ["settings"]
    assert FROZEN.search("Status: frozen on 2026-12-01 at 0123abc.")
    assert not FROZEN.search("Once the status line is `Status: frozen on DATE at COMMIT.`")
