import itertools
from dataclasses import replace

import numpy as np
import pytest
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure

from mtcsirl.claims.claims import judge, load_criteria
from mtcsirl.cli import main
from mtcsirl.figures.claims import VERDICT_COLOURS, caption, claims_figure
from mtcsirl.files.storage import read_json, read_text, write_json, write_text
from mtcsirl.report.results_page import results_page
from mtcsirl.results.rows import evaluation_rows
from mtcsirl.results.statistics import Estimate
from mtcsirl.settings import Settings
from mtcsirl.study.design import design
from mtcsirl.tables import TABLES
from tests.claims.made_up import SETTINGS, as_the_paper_says, evaluation, judge_all, rows_of, scores

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def findings():
    return judge_all()


def texts(figure):
    return [text.get_text() for axes in figure.axes for text in axes.texts]


def test_figure_has_a_row_and_a_verdict_per_claim(findings):
    figure = claims_figure(findings, SETTINGS)
    assert isinstance(figure, Figure)
    found = texts(figure)
    assert [text for text in found if text in load_criteria()["claims"]] == list(load_criteria()["claims"])
    assert [found.count(verdict) for verdict in ("reproduced", "reproduced (gate)")] == [11, 2]
    sentences = [" ".join(text.split()) for text in found]
    assert all(finding.text in sentences for finding in findings), "whole sentences"
    drawn = figure.axes[1].lines
    assert len([line for line in drawn if line.get_marker() == "o"]) == len(findings[0].units)
    assert "Preconditions, settings and the reading of each claim were not" in caption()


def test_figure_fits_a_page_and_its_text_is_no_small_print(findings):
    figure = claims_figure(findings, SETTINGS)
    width, height = figure.get_size_inches()
    assert width <= 5.5
    assert height <= 9.5
    sizes = [text.get_fontsize() for axes in figure.axes for text in (*axes.texts, *axes.get_yticklabels())]
    assert min(sizes) >= 6


def test_verdicts_differ_in_colour_and_can_be_read_on_white():
    assert len(set(VERDICT_COLOURS.values())) == len(VERDICT_COLOURS)
    for colour in VERDICT_COLOURS.values():
        channels = np.array(to_rgb(colour))
        linear = np.where(channels <= 0.04045, channels / 12.92, ((channels + 0.055) / 1.055) ** 2.4)
        assert 1.05 / (linear @ [0.2126, 0.7152, 0.0722] + 0.05) > 4.5, colour


def test_figure_shows_each_units_limit_and_the_papers_number(findings):
    right = {f.name: axes for f, axes in zip(findings, claims_figure(findings, SETTINGS).axes[1::2], strict=True)}
    units = {f.name: [unit for unit in f.units if unit.state != "not judged"] for f in findings}
    for name in ("C1", "C7"):
        black = [line for line in right[name].lines if line.get_color() == "black"]
        assert len(black) == len(units[name])
        triangles = [line.get_xdata()[0] for line in right[name].lines if line.get_marker() == "v"]
        assert triangles == [unit.paper_value for unit in units[name]]
    limits = [line.get_xdata()[0] for line in right["C1"].lines if line.get_color() == "black"]
    assert limits == [0.05] * 4 + [0.15] * 4, "action norm above velocity"
    assert not [line for line in right["C2"].lines if line.get_marker() == "v"], "the paper prints no number"


def test_nothing_of_the_figure_is_cut_off(findings):
    figure = claims_figure(findings, SETTINGS)
    figure.canvas.draw()
    for axes in figure.axes:
        ticks = axes.get_yticklabels() if axes.axison else ()
        for text in (*axes.texts, axes.xaxis.label, *ticks):
            box = text.get_window_extent()
            if text.get_text():
                assert figure.bbox.x0 - 1 <= box.x0, text
                assert box.x1 <= figure.bbox.x1 + 1, text


def collisions(figure):
    """Texts and labels of a claim that lie over its own others or over the next claim's."""
    figure.canvas.draw()
    boxes = [
        [text.get_window_extent() for text in (*axes.texts, *(axes.get_yticklabels() if axes.axison else ()))]
        for axes in figure.axes
    ]
    rows = [left + right for left, right in zip(boxes[::2], boxes[1::2], strict=True)]
    pairs = [pair for row in rows for pair in itertools.combinations(row, 2)]
    pairs += [pair for above, below in itertools.pairwise(rows) for pair in itertools.product(above, below)]
    return [pair for pair in pairs if pair[0].shrunk(0.98, 0.9).overlaps(pair[1].shrunk(0.98, 0.9))]


@pytest.mark.parametrize("width", [46, 80])
def test_no_text_of_the_figure_lies_over_another(findings, width, monkeypatch):
    """C8's sentence stands beside its long labels; in wider lines it would lie under them."""
    monkeypatch.setattr("mtcsirl.figures.claims._SENTENCE", width)
    assert bool(collisions(claims_figure(findings, SETTINGS))) == (width > 46)


def test_an_interval_that_goes_on_ends_in_an_arrow(findings):
    def arrows(finding):
        axes = claims_figure([finding], SETTINGS).axes[1]
        return [line.get_marker() for line in axes.lines if line.get_marker() in ("<", ">")]

    unit = replace(findings[4].units[0], value=Estimate(0.8, -np.inf, np.inf, 5))
    assert arrows(replace(findings[4], units=(unit, *findings[4].units[1:]))) == ["<", ">"]
    assert arrows(findings[4]) == []


def test_the_papers_r_is_no_partial_r(findings):
    """Its triangle is open; where ours and the paper's are the same measure it is filled."""
    faces = {}
    for finding, axes in zip(findings, claims_figure(findings, SETTINGS).axes[1::2], strict=True):
        faces[finding.name] = {line.get_markerfacecolor() for line in axes.lines if line.get_marker() == "v"}
    assert faces["C4"] == faces["C9"] == {"white"}
    assert faces["C5"] == faces["C7"] == {"0.25"}


def test_figure_of_nothing_and_of_smoke_says_so():
    nothing = judge(rows_of(as_the_paper_says).iloc[:0], scores().iloc[:0], SETTINGS)
    smoke = claims_figure(nothing, SETTINGS.model_copy(update={"scale": "smoke"}))
    assert [texts(smoke).count(text) for text in ("not run", "not run (gate)")] == [11, 2]
    assert "smoke scale" in smoke.get_supxlabel()


def test_the_shaded_region_is_that_of_the_criterion(findings):
    holds = {f.name: {tuple(unit.holds) for unit in f.units} for f in findings}
    assert holds["C1"] == {(-np.inf, 0.05), (-np.inf, 0.15)}
    assert holds["C3"] == {(-0.25, 0.25)}
    assert holds["C7"] == {(0.5, np.inf)}
    assert holds["C6"] == {(-np.inf, 0.25)}
    assert all(low < high for regions in holds.values() for low, high in regions)


def test_page_has_verdicts_tables_and_deviations_once(findings):
    rows = {name: evaluation(design(SETTINGS, name), as_the_paper_says) for name in ("table_2", "table_4")}
    tables = {name: TABLES[name](frame, SETTINGS) for name, frame in rows.items()}
    page = results_page(findings, tables, SETTINGS, provenance={"commit": "abc"})
    assert page.count(f"sac.minibatch = {SETTINGS.sac.minibatch}") == 1
    assert all(f"### {title}" in page for title in ("Table 2", "Table 4", "C1 (gate): reproduced"))
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
    assert "### C1 (gate): reproduced" in page
    assert "### C2" not in page
    assert f"Not run yet: {', '.join(finding.name for finding in nothing[1:])}." in page


def test_verbs_work_on_partial_and_refuse_missing_results(tmp_path, capsys):
    small = Settings(
        results=str(tmp_path / "results"),
        seeds=(0,),
        irl_seeds=(0,),
        single_target={"tasks": ("reach-wall",)},
        multi_target={"tasks": ("reach-wall",), "train_targets": (1,)},
        multi_task={"train_tasks": ("reach", "door-close"), "train_targets": (1,), "unseen_tasks": ("push-back",)},
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


def test_the_page_lands_in_the_studys_folder_and_not_in_somebodys_docs(tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    write_text(tmp_path / "docs" / "results.md", "of another study")
    words = ["results", "--partial", "--scale", "smoke", "--set", "results=mine", "--set", "figures=mine"]
    assert main(words) == 0
    assert capsys.readouterr().out == "mine/results.md\n"
    assert "smoke scale: " in read_text(tmp_path / "mine" / "results.md")
    assert read_text(tmp_path / "docs" / "results.md") == "of another study"
    assert main([*words, "--output", "docs"]) == 0
    assert "smoke scale: " in read_text(tmp_path / "docs" / "results.md")
