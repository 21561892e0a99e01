import pytest
from matplotlib.figure import Figure

from mtcsirl.claims.claims import judge, load_criteria
from mtcsirl.cli import main
from mtcsirl.figures.claims import claims_figure, limits_of
from mtcsirl.files.storage import read_json, read_text, write_json
from mtcsirl.report.results_page import results_page
from mtcsirl.results.rows import evaluation_rows
from mtcsirl.settings import Settings
from mtcsirl.study.design import design
from mtcsirl.tables import TABLES
from tests.claims.made_up import SETTINGS, as_the_paper_says, evaluation, rows_of, scores


@pytest.fixture(scope="module")
def findings():
    return judge(rows_of(as_the_paper_says), scores(), SETTINGS)


def texts(figure):
    return [text.get_text() for axes in figure.axes for text in axes.texts]


def test_figure_has_a_row_and_a_verdict_per_claim(findings):
    figure = claims_figure(findings, SETTINGS)
    assert isinstance(figure, Figure)
    found = texts(figure)
    assert [text for text in found if text in load_criteria()["claims"]] == list(load_criteria()["claims"])
    assert found.count("reproduced") == 12
    drawn = figure.axes[0].lines
    assert len([line for line in drawn if line.get_marker() == "o"]) == len(findings[0].units)


def test_figure_shows_each_units_limit_and_the_papers_number(findings):
    left = {f.name: axes for f, axes in zip(findings, claims_figure(findings, SETTINGS).axes[::2], strict=True)}
    units = {f.name: f.units for f in findings}
    for name in ("C1", "C7"):
        black = [line for line in left[name].lines if line.get_color() == "black"]
        assert len(black) == len(units[name])
        triangles = [line.get_xdata()[0] for line in left[name].lines if line.get_marker() == "v"]
        assert triangles == [unit.paper_value for unit in units[name]]
    limits = [line.get_xdata()[0] for line in left["C1"].lines if line.get_color() == "black"]
    assert limits == [0.05] * 4 + [0.15] * 4, "action norm above velocity"
    assert not [line for line in left["C2"].lines if line.get_marker() == "v"], "the paper prints no number"


def test_nothing_of_the_figure_is_cut_off(findings):
    figure = claims_figure(findings, SETTINGS)
    figure.canvas.draw()
    for axes in figure.axes:
        for text in (*axes.texts, axes.xaxis.label, *axes.get_yticklabels()):
            box = text.get_window_extent()
            if text.get_text():
                assert figure.bbox.x0 - 1 <= box.x0, text
                assert box.x1 <= figure.bbox.x1 + 1, text


def test_figure_of_nothing_and_of_smoke_says_so():
    nothing = judge(rows_of(as_the_paper_says).iloc[:0], scores().iloc[:0], SETTINGS)
    smoke = claims_figure(nothing, SETTINGS.model_copy(update={"scale": "smoke"}))
    assert texts(smoke).count("not run") == 12
    assert "smoke scale" in smoke.get_supxlabel()


def test_limits_are_those_of_the_criteria(findings):
    rules = load_criteria()["claims"]
    drawn = {f.name: {limit for unit in f.units for limit in limits_of(rules[f.name], unit)} for f in findings}
    assert drawn["C1"] == {0.05, 0.15}
    assert drawn["C3"] == {-0.25, 0.25}
    assert drawn["C7"] == {0.5}


def test_page_has_verdicts_tables_and_deviations_once(findings):
    rows = {name: evaluation(design(SETTINGS, name), as_the_paper_says) for name in ("table_2", "table_4")}
    tables = {name: TABLES[name](frame, SETTINGS) for name, frame in rows.items()}
    page = results_page(findings, tables, SETTINGS, provenance={"commit": "abc"})
    assert page.count(f"sac.minibatch = {SETTINGS.sac.minibatch}") == 1
    assert all(f"### {title}" in page for title in ("Table 2", "Table 4", "C1: reproduced"))
    assert "| commit | abc |" in page
    assert "Not run yet" not in page
    assert "No run yet" not in page


def test_page_of_nothing_is_short():
    """It names what was not run, and does not spell out empty tables."""
    nowhere = SETTINGS.model_copy(update={"results": "nowhere"})
    nothing = judge(rows_of(as_the_paper_says).iloc[:0], scores().iloc[:0], SETTINGS)
    tables = {
        name: table(evaluation_rows(design(SETTINGS, name), nowhere, partial=True), SETTINGS)
        for name, table in TABLES.items()
    }
    page = results_page(nothing, tables, SETTINGS, provenance={"commit": "abc"})
    assert len(page.splitlines()) < 60
    assert f"Not run yet: {', '.join(finding.name for finding in nothing)}." in page
    assert "No run yet, or no part of this study: Table 1, Table 2, Table 3, Table 4." in page
    assert "### Table 5" in page, "which needs no run"
    assert "`mtcsirl deviations` prints them" in page


def test_page_of_a_part_shows_that_part(findings):
    """A claim that was judged keeps its numbers beside those that were not."""
    nothing = judge(rows_of(as_the_paper_says).iloc[:0], scores().iloc[:0], SETTINGS)
    page = results_page([findings[0], *nothing[1:]], {}, SETTINGS)
    assert "### C1: reproduced" in page
    assert "### C2" not in page
    assert f"Not run yet: {', '.join(finding.name for finding in nothing[1:])}." in page


def test_verbs_work_on_partial_and_refuse_missing_results(tmp_path, capsys):
    small = Settings(
        results=str(tmp_path / "results"),
        seeds=(0,),
        irl_seeds=(0,),
        single_target={"tasks": ("reach-wall",)},
        multi_target={"tasks": ("reach-wall",), "train_targets": (1,)},
        multi_task={"train_tasks": ("reach",), "train_targets": (1,), "unseen_tasks": ("push-back",)},
    )
    write_json(tmp_path / "settings.json", small.model_dump(mode="json"))
    settings = ["--settings", read_text(tmp_path / "settings.json")]
    output = ["--output", str(tmp_path / "out")]
    assert main(["table", "2", *settings, *output]) == 2
    complaint = capsys.readouterr().err.strip()
    assert complaint.count("\n") == 0
    assert "this run is missing" in complaint
    assert main(["table", "2", "--partial", *settings, *output]) == 0
    assert "‡" in read_text(tmp_path / "out" / "table_2.md")
    assert main(["claims", "--partial", *settings, *output]) == 0
    claims = read_json(tmp_path / "out" / "claims.json")["claims"]
    assert {claim["verdict"] for claim in claims} == {"not run"}
    assert (tmp_path / "out" / "claims.png").stat().st_size > 1000
    assert main(["results", "--partial", *settings, *output]) == 0
    assert "## Which claims hold" in read_text(tmp_path / "out" / "results.md")
