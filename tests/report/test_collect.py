"""The content of the page from a made-up results folder."""

import re
from pathlib import Path

import pandas as pd
import pytest

from mtcsirl.claims.claims import claims_json, judge
from mtcsirl.errors import UserError
from mtcsirl.figures.style import figure_bytes, new_figure
from mtcsirl.files import storage
from mtcsirl.report.collect import collect
from mtcsirl.report.markdown import parse_table
from mtcsirl.report.page import build_report
from mtcsirl.results.rows import ROW_COLUMNS, SCORE_COLUMNS
from mtcsirl.settings import Settings
from mtcsirl.study.design import ARTEFACTS, design
from mtcsirl.study.outputs import OUTPUTS

TABLE = """**Table 1.** Ratio to the
target.

| learned on | reach-wall | A\\|B |
| :-- | --: | --: |
| reach-wall | **0.91 ± 0.03, n=5** | – ‡5 |
| paper | 0.91 | 0.43, outside [0.1, 0.2] |

- scale desk; 5 seeds
- ‡ missing agents
"""
PROVENANCE = {
    "commit": "abc123",
    "versions": {"torch": "2.13.0"},
    "machine": {"processor": "Chip", "cores": 2, "system": "Linux", "python": "3.11.7"},
    "cost": {"wall_seconds": 900.0, "cpu_seconds": 720.0, "peak_memory_mib": 500.5},
    "inputs": {},
}
NO_ROWS = pd.DataFrame({name: [] for name in ROW_COLUMNS})
NO_SCORES = pd.DataFrame({name: [] for name in SCORE_COLUMNS})


@pytest.fixture(scope="module")
def results(tmp_path_factory):
    """Settings of a study of one seed whose results folder holds everything but weights and curves."""
    root = tmp_path_factory.mktemp("study")
    settings = Settings(
        results=str(root / "results"), figures=str(root / "figures"), seeds=(0,), irl_seeds=(0,), methods=("mt_csirl",)
    )
    for run in design(settings):
        storage.write_json(root / "results" / run.folder / "provenance.json", PROVENANCE)
        if "gate.json" in OUTPUTS[run.stage]:
            passed = getattr(run, "task", "") != "push-back"
            gate = {"passed": passed, "success": float(passed), "metric": 0.8}
            members = [gate | {"task": task, "target": target} for task, target in getattr(run, "members", ())]
            storage.write_json(
                root / "results" / run.folder / "gate.json", gate | ({"members": members} if members else {})
            )
    png = figure_bytes(new_figure(1, 1), "png", "what it shows, n = 1 seed")
    storage.write_bytes(root / "results" / "tables" / "table_1.png", png)
    for name in ARTEFACTS:
        if name.startswith("table_"):
            for ending in ("md", "csv", "tex"):
                storage.write_text(root / "results" / "tables" / f"{name}.{ending}", TABLE)
        else:
            storage.write_bytes(root / "figures" / f"{name}.png", png)
            storage.write_bytes(root / "figures" / f"{name}.pdf", b"%PDF")
    storage.write_json(
        root / "results" / "claims" / "claims.json", claims_json(judge(NO_ROWS, NO_SCORES, settings), settings)
    )
    return settings, root


def test_whole_study(results):
    settings, root = results
    data = collect(settings, root / "results" / "report" / "index.html")
    assert data.missing == ()
    assert data.run.commits == ("abc123",)
    assert data.run.machines == ("Chip, 2 cores, Linux, Python 3.11.7",)
    jobs = design(settings).jobs()
    assert {stage.stage: (stage.done, stage.planned) for stage in data.run.stages} == {
        stage: (number, number) for stage, number in jobs.items()
    }
    experts = data.run.stages[0]
    assert experts.cpu_seconds == pytest.approx(720 * jobs["train_expert"])
    assert experts.peak_memory_mib == 500.5
    assert [table.name for table in data.tables] == [f"table_{n}" for n in range(1, 6)]
    assert [table.name for table in data.tables if table.picture] == ["table_1"]
    assert [figure.name for figure in data.figures] == [name for name in ARTEFACTS if name.startswith("figure_")]
    assert {figure.caption for figure in data.figures} == {"what it shows, n = 1 seed"}


def test_claims_are_the_judged_ones(results):
    settings, root = results
    claims = collect(settings, root / "page.html").claims
    assert [claim.name for claim in claims] == [f"C{number}" for number in range(1, 14)]
    assert {claim.verdict for claim in claims} == {"not run"}
    assert claims[0].locus == "Table 2, row Expert"
    assert claims[0].units[0]["unit"].endswith("reach-wall")
    assert all(claim.criterion and claim.reason for claim in claims)


def test_gates_are_counted_by_agent_task_and_cs_reward(results):
    settings, root = results
    gates = {(line.gate, line.task, line.cs_reward): line for line in collect(settings, root / "page.html").gates}
    assert (gates["SAC", "push-back", ""].passed, gates["SAC", "push-back", ""].agents) == (0, 1)
    generator = gates["generator, multi task, mt csirl", "reach", "velocity"]
    assert (generator.passed, generator.agents, generator.metric) == (1, 1, 0.8)
    transfers = gates["transfer agent, multi target, mt csirl", "reach-wall", "velocity"]
    assert transfers.agents == 5  # one per source task


def test_targets_cost_what_their_runs_did(results):
    settings, root = results
    lines = {line.target: line for line in collect(settings, root / "page.html").targets}
    assert list(lines) == [*ARTEFACTS, "claims", "report", "all"]
    jobs = sum(design(settings, "table_2").jobs().values())
    assert (lines["table_2"].done, lines["table_2"].planned) == (jobs, jobs)
    assert lines["table_2"].cpu_seconds == pytest.approx(720 * jobs)
    assert lines["table_5"].planned == 0


def test_links_lead_to_files(results):
    settings, root = results
    page = root / "results" / "report" / "index.html"
    storage.write_text(page, build_report(collect(settings, page)))
    links = [link for link in re.findall(r'href="([^"]+)"', page.read_text()) if not link.startswith(("#", "data:"))]
    assert len(links) == 3 * 5 + 2 * 11 + 1
    for link in links:
        assert (page.parent / link).is_file(), link


def test_missing_artefact_is_an_error_unless_partial(results):
    settings, root = results
    storage.remove(root / "figures" / "figure_3.png")
    try:
        with pytest.raises(UserError, match=r"figure_3\.png: not there; make it with `snakemake figure_3`"):
            collect(settings, root / "page.html")
        data = collect(settings, root / "page.html", partial=True)
        assert [name for name, _ in data.missing] == ["figure_3"]
        assert "figure_3" not in [figure.name for figure in data.figures]
    finally:
        storage.write_bytes(
            root / "figures" / "figure_3.png", figure_bytes(new_figure(1, 1), "png", "what it shows, n = 1 seed")
        )


def test_nothing_there(tmp_path):
    settings = Settings(results=str(tmp_path / "r"), figures=str(tmp_path / "f"))
    data = collect(settings, tmp_path / "index.html", partial=True)
    assert len(data.missing) == len(ARTEFACTS)
    assert sum(stage.done for stage in data.run.stages) == 0
    assert "Partial results" in build_report(data)


def test_deviations_are_those_of_the_settings():
    settings = Settings(results="nowhere", figures="nowhere", sac={"minibatch": 128})
    data = collect(settings, Path("nowhere/index.html"), partial=True)
    minibatch = next(line for line in data.deviations if line.key == "sac.minibatch")
    assert (minibatch.ours, minibatch.paper) == ("128 transitions", "500")


def test_table_is_read_back_from_markdown():
    table = parse_table(TABLE)
    assert table.caption == "Ratio to the target."
    assert table.head == ("learned on", "reach-wall", "A|B")
    assert table.rows == (
        ("reach-wall", "**0.91 ± 0.03, n=5**", "– ‡5"),
        ("paper", "0.91", "0.43, outside [0.1, 0.2]"),
    )
    assert table.notes == ("scale desk; 5 seeds", "‡ missing agents")


@pytest.mark.parametrize("text", ["", "no table", "| a | b |\n| --: | --: |\n| 1 |\n"])
def test_foreign_markdown_is_named(text):
    with pytest.raises(UserError, match=r"table_9\.md: not a table in Markdown"):
        parse_table(text, "table_9.md")
