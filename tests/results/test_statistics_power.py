"""The recorded simulations: what they must reach, that they can be made again, and that the documents print them."""

import json

import pytest
from benchmarks.statistics_power import FILE, STUDIES, coverages, errors, rows, simulate, table

from tests.conftest import CHECKOUT

RECORDED = json.loads(FILE.read_text(encoding="utf-8"))["rows"]


def shares(kind: str) -> list[dict]:
    return [row for row in RECORDED if row["kind"] == kind]


def test_nominal_intervals_cover_93_to_97_percent():
    assert len(shares("coverage")) == 13
    assert {row["model"]: row["share"] for row in shares("coverage") if not 0.93 <= row["share"] <= 0.97} == {}


def test_met_by_mistake_is_rare():
    """Shares of ten episodes are coarse: 48 of 50 are called surely 90 %. The documents say so."""
    assert len(shares("error")) == 8
    rare = {row["test"]: row["share"] for row in shares("error")}
    coarse = rare.pop("at least (success)")
    assert max(rare.values()) <= 0.06
    assert 0.06 < coarse <= 0.10


def test_power_falls_with_the_spread():
    equivalence = [row["share"] for row in shares("power") if row["test"] == "equivalence (C3)"]
    assert equivalence == sorted(equivalence, reverse=True)
    assert equivalence[0] > 0.99
    assert equivalence[-1] < 0.1, "a test that passes anything would not fall"


@pytest.mark.parametrize(("kind", "number", "cases"), [("coverage", 0, coverages), ("error", 1, errors)])
def test_what_is_recorded_is_what_the_code_gives_today(kind, number, cases):
    test, model, draw = list(cases())[number]
    again = simulate(kind, number, test, model, draw, STUDIES)
    assert again in RECORDED


def test_every_case_of_the_script_is_recorded(monkeypatch):
    monkeypatch.setattr("benchmarks.statistics_power.STUDIES", 1)
    monkeypatch.setattr(
        "benchmarks.statistics_power.simulate", lambda kind, number, test, model, draw: (kind, test, model)
    )
    named = {(row["kind"], row["test"], row["model"]) for row in RECORDED}
    assert named - set(rows()) == {key for key in named if key[1] == "partial r (C4, C9)"}
    assert set(rows()) <= named


def test_the_documents_print_what_is_recorded():
    assert table(RECORDED) in (CHECKOUT / "docs" / "methods.md").read_text(encoding="utf-8")
