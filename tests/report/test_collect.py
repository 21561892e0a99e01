"""The content of the page from a made-up results folder."""

import re
from pathlib import Path

import pandas as pd
import pytest

from mtcsirl.claims.claims import claims_json, judge
from mtcsirl.errors import UserError
from mtcsirl.figures.style import figure_bytes, new_figure
from mtcsirl.files import storage
from mtcsirl.files.identity import FILE, Record, checksums, dumps, result_files
from mtcsirl.report.collect import collect
from mtcsirl.report.measured import measured
from mtcsirl.report.page import build_report
from mtcsirl.report.verdicts import claims_of
from mtcsirl.results.notes import Note
from mtcsirl.results.rows import ROW_COLUMNS, SCORE_COLUMNS
from mtcsirl.settings import Settings
from mtcsirl.study.artefacts import record_folder, sign_artefact
from mtcsirl.study.design import ARTEFACTS, CLAIMS, design
from mtcsirl.study.keys import identity_of
from mtcsirl.study.outputs import OUTPUTS
from mtcsirl.tables.grid import Column, Grid, Line
from mtcsirl.tables.table import Table
from tests.claims.made_up import SETTINGS as JUDGED
from tests.claims.made_up import judge_all

TABLE = Table(
    "table_1",
    "Ratio to the target.",
    Grid("learned on", (Column("ours", "A|B"), Column("paper", "A|B")), (Line("reach-wall", ("– ‡5", "0.91")),)),
    (Note("scale", "scale desk; 5 seeds"), Note("mark", "‡ missing agents")),
)
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
        folder = root / "results" / run.folder
        storage.write_json(folder / "provenance.json", PROVENANCE)
        if "gate.json" in OUTPUTS[run.stage]:
            passed = getattr(run, "task", "") != "push-back"
            gate = {"passed": passed, "success": float(passed), "metric": 0.8}
            members = [gate | {"task": task, "target": target} for task, target in getattr(run, "members", ())]
            storage.write_json(folder / "gate.json", gate | ({"members": members} if members else {}))
        record = Record(identity_of(run, settings), checksums(folder, result_files(folder)), {})
        storage.write_text(folder / FILE, dumps(record))
    png = figure_bytes(new_figure(1, 1), "png", "what it shows, n = 1 seed")
    storage.write_bytes(root / "results" / "tables" / "table_1.png", png)
    for name in ARTEFACTS:
        if name.startswith("table_"):
            storage.write_json(root / "results" / "tables" / f"{name}.json", TABLE.as_json())
            for ending in ("md", "csv", "tex"):
                storage.write_text(root / "results" / "tables" / f"{name}.{ending}", TABLE.markdown())
        else:
            storage.write_bytes(root / "figures" / f"{name}.png", png)
            storage.write_bytes(root / "figures" / f"{name}.pdf", b"%PDF")
    storage.write_json(
        root / "results" / "claims" / "claims.json", claims_json(judge(NO_ROWS, NO_SCORES, settings), settings)
    )
    for name in (*ARTEFACTS, CLAIMS):
        sign(settings, name)
    return settings, root


def sign(settings, name):
    """Sign an artefact whatever its files hold."""
    homes = {"table": Path(settings.results) / "tables", "claims": Path(settings.results) / "claims"}
    files = homes.get(name.partition("_")[0], Path(settings.figures)).glob(f"{name}.*")
    sign_artefact(name, settings, sorted(files))


class Replaced:
    """A file with another content; the artefact is signed anew with ``signed``, and all is as before in the end."""

    def __init__(self, settings, name, path, content, signed=False):
        self.settings, self.path, self.content, self.signed = settings, path, content, signed
        self.name, self.record = name, record_folder(name, settings.results) / FILE

    def __enter__(self):
        self.kept = {path: path.read_bytes() for path in (self.path, self.record)}
        self.path.write_bytes(self.content)
        if self.signed:
            sign(self.settings, self.name)

    def __exit__(self, *error):
        for path, content in self.kept.items():
            path.write_bytes(content)


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
    assert [table.picture.title for table in data.tables if table.picture] == ["Table 1 as a heat map"]
    assert [figure.name for figure in data.figures] == [name for name in ARTEFACTS if name.startswith("figure_")]
    assert {figure.caption for figure in data.figures} == {"what it shows, n = 1 seed"}


def test_claims_are_the_judged_ones(results):
    settings, root = results
    claims = collect(settings, root / "page.html").claims
    assert [claim.name for claim in claims] == [f"C{number}" for number in range(1, 14)]
    assert {claim.verdict for claim in claims} == {"not run"}
    assert claims[0].locus == "Table 2, row Expert"
    assert claims[0].units[0].texts["unit"].endswith("reach-wall")
    assert [claim.name for claim in claims if claim.gate] == ["C1", "C2"]
    assert {leans for claim in claims for leans, _ in claim.departures} == {"for", "against"}
    assert collect(settings, root / "page.html").beforehand.startswith("Thresholds were fixed before")
    assert all(claim.criterion and claim.reason for claim in claims)


@pytest.mark.parametrize("signed", [False, True])
@pytest.mark.parametrize("text", ["[]", '{"claims": [{"name": "C1"}]}', '{"claims": 3}', "not json"])
def test_foreign_claims_are_named_and_left_out_of_a_page_of_a_part(results, text, signed):
    settings, root = results
    path = root / "results" / "claims" / "claims.json"
    with Replaced(settings, CLAIMS, path, text.encode(), signed):
        with pytest.raises(UserError, match=r"claims\.json") as caught:
            collect(settings, root / "page.html")
        assert "\n" not in str(caught.value)
        data = collect(settings, root / "page.html", partial=True)
        assert data.claims == ()
        (caution,) = data.cautions
        assert caution.startswith("Left out: Claims (")
        assert caution.endswith("Make it again with these settings, as by `mtcsirl claims --partial`.")
        assert len(data.tables) == 5, "the others stay"


def test_units_keep_their_state_outcome_power_and_remarks():
    """Of a made-up study: C3's power, C7's mean over tasks, which is not judged, C4's remarks."""
    c3, c4, c7 = claims_of(claims_json(judge_all(names=("C3", "C4", "C7")), JUDGED))
    assert {unit.outcome for unit in c3.units} == {"like SAC"}
    assert all(unit.remarks[0].startswith("power ") for unit in c3.units)
    assert not any(remark.startswith("power ") for unit in c7.units for remark in unit.remarks)
    assert any(remark.startswith("r by set: ") for remark in c4.units[0].remarks)
    assert [unit.texts["unit"] for unit in c7.units if not unit.judged] == [
        "action norm, all unseen tasks",
        "velocity, all unseen tasks",
    ]
    assert (c7.judged, len(c7.units)) == (8, 10)
    assert c7.measured.count("(4 units)") == 2


def test_units_know_their_runs():
    """C3 looks at new agents and at SAC, C4 at scores; an agent that is missing is no run of any."""
    c3, c4 = claims_of(claims_json(judge_all(names=("C3", "C4")), JUDGED))
    for unit in c3.units:
        assert {folder.split("/")[0] for folder in unit.folders} == {"transfer", "sac"}
        assert len(unit.folders) == 2 * len(JUDGED.seeds)
    assert all(folder.startswith("scores/single_target/mt_csirl/") for unit in c4.units for folder in unit.folders)
    (c3,) = claims_of(claims_json(judge_all(change=_without_sac, names=("C3",)), JUDGED))
    assert {folder.split("/")[0] for unit in c3.units for folder in unit.folders} == {"transfer"}


def _without_sac(rows):
    return rows.assign(value=rows["value"].mask(rows["stage"] == "train_sac"))


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
    rows = [link for link in links if link.endswith("/gate.json")]
    assert len(links) - len(rows) == 4 * 5 + 3 * 11 + 1
    assert rows, "of demonstrations, whose gate is all that this study has"
    for link in links:
        assert (page.parent / link).is_file(), link


def test_missing_artefact_is_an_error_unless_partial(results):
    settings, root = results
    storage.remove(root / "figures" / "figure_3.png")
    try:
        with pytest.raises(UserError, match=r"figure_3\.png: not there"):
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


def test_tables_are_read_as_data(results):
    settings, root = results
    assert collect(settings, root / "page.html").tables[0].table.as_json() == TABLE.as_json()


@pytest.mark.parametrize("signed", [False, True])
@pytest.mark.parametrize("text", ["", "{}", "[]", '{"name": "table_1"}', "not json"])
def test_a_foreign_table_is_named_and_left_out_of_a_page_of_a_part(results, text, signed):
    settings, root = results
    path = root / "results" / "tables" / "table_1.json"
    with Replaced(settings, "table_1", path, text.encode(), signed):
        with pytest.raises(UserError, match=r"table_1\.json") as caught:
            collect(settings, root / "page.html")
        assert "\n" not in str(caught.value)
        data = collect(settings, root / "page.html", partial=True)
        assert [table.name for table in data.tables] == ["table_2", "table_3", "table_4", "table_5"]
        assert data.cautions[0].startswith("Left out: Table 1 (")


@pytest.mark.parametrize("signed", [False, True])
@pytest.mark.parametrize("content", [b"", b"no picture", b"\x89PNG\r\n\x1a\n"])
def test_a_damaged_picture_is_named_and_left_out_of_a_page_of_a_part(results, content, signed):
    settings, root = results
    for name, path in (("figure_s1", root / "figures/figure_s1.png"), ("table_1", root / "results/tables/table_1.png")):
        with Replaced(settings, name, path, content, signed):
            with pytest.raises(UserError, match=path.stem) as caught:
                collect(settings, root / "page.html")
            assert "\n" not in str(caught.value)
            data = collect(settings, root / "page.html", partial=True)
            assert name not in [view.name for view in (*data.tables, *data.figures)]
            assert len(data.cautions) == 1
            assert data.cautions[0] in build_report(data).replace("&#39;", "'")


def test_a_picture_that_no_record_answers_for_is_not_shown(results):
    """Left by an older study beside a table that has none today."""
    settings, root = results
    stray = root / "results" / "tables" / "table_2.png"
    stray.write_bytes((root / "results" / "tables" / "table_1.png").read_bytes())
    try:
        shown = {view.name for view in collect(settings, root / "page.html").tables if view.picture}
        assert shown == {"table_1"}
    finally:
        stray.unlink()


def test_an_edited_number_of_a_signed_table_is_seen(results):
    settings, root = results
    path = root / "results" / "tables" / "table_5.json"
    edited = path.read_bytes().replace(b"0.91", b"0.19")
    says = r"table_5\.json changed since it was written"
    with Replaced(settings, "table_5", path, edited), pytest.raises(UserError, match=says):
        collect(settings, root / "page.html")


def test_a_table_signed_in_another_folder_is_not_taken_from_this_one(results):
    settings, root = results
    record = record_folder("table_5", settings.results) / FILE
    elsewhere = root / "elsewhere" / "table_5.json"
    path = root / "results" / "tables" / "table_5.json"
    storage.write_bytes(elsewhere, path.read_bytes())
    with Replaced(settings, "table_5", path, path.read_bytes()):
        sign_artefact("table_5", settings, [elsewhere])
        assert record.is_file()
        with pytest.raises(UserError, match=r"table_5\.json: signed in another folder"):
            collect(settings, root / "page.html")


def unit(cs_reward, value, low, high, *, name="part closed", answer="met", unbounded=False):
    measure = {"name": name, "value": value, "low": low, "high": high, "unbounded": unbounded}
    return {"cs_reward": cs_reward, "answer": answer, "measure": measure}


def test_what_a_claim_measured_is_one_line():
    one = [unit("velocity", 0.84, 0.8, 0.88), unit("action_norm", 0.9, None, None)]
    assert measured(one) == "part closed: velocity 0.84 [0.80, 0.88], action norm 0.90"
    several = [unit("velocity", 0.6, 0.5, 0.7), unit("velocity", 0.8, 0.75, 0.93), unit("velocity", None, None, None)]
    assert measured(several) == "part closed: velocity 0.60 to 0.80 [0.50, 0.93] (2 units)"
    assert measured([unit("velocity", 0.051, -0.001, 0.06), unit("velocity", 0.049, 0.0, 0.07)]) == (
        "part closed: velocity 0.05 [0.00, 0.07] (2 units)"
    )
    assert measured([unit("velocity", None, None, None)]) == measured([]) == measured([{}]) == "nothing measured yet"


def test_units_for_comparison_are_not_measured():
    shown = unit("velocity", 0.2, 0.1, 0.3, answer="not judged")
    assert measured([shown, unit("velocity", 0.84, 0.8, 0.88)]) == "part closed: velocity 0.84 [0.80, 0.88]"
    assert measured([shown]) == "nothing measured yet"
    counted = measured([shown | {"answer": "unclear"}, unit("velocity", 0.84, 0.8, 0.88)])
    assert counted == "part closed: velocity 0.20 to 0.84 [0.10, 0.88] (2 units)"


def test_units_without_their_precondition_are_counted_alone():
    blocked = unit("velocity", 3.9, -1.0, 9.0, answer="precondition not met")
    assert measured([blocked, unit("velocity", 0.84, 0.8, 0.88)]) == (
        "part closed: velocity 0.84 [0.80, 0.88]; 1 unit lacks its precondition"
    )
    assert measured([blocked, blocked]) == "2 units lack their precondition"


def test_intervals_without_finite_ends_are_said_in_words():
    endless, known = unit("velocity", 0.84, None, None, unbounded=True), unit("velocity", 0.9, 0.8, 1.0)
    assert measured([endless]) == "part closed: velocity 0.84 [no finite bounds]"
    assert measured([endless, known]) == (
        "part closed: velocity 0.84 to 0.90 [0.80, 1.00; no finite bounds for 1] (2 units)"
    )
    assert measured([unit("velocity", 0.84, None, None)]) == "part closed: velocity 0.84", "one seed: no interval"


def test_endless_intervals_reach_the_page_from_the_claims():
    """SAC's gap is not surely there: Fieller's set has no ends; with SAC's gap there it has."""
    wide = claims_json(judge_all(change=_scattered_sac, names=("C7",)), JUDGED)
    (claim,) = claims_of(wide)
    assert "no finite bounds" in claim.measured
    assert any("no finite bounds" in unit.texts["measure"] for unit in claim.units)
    (claim,) = claims_of(claims_json(judge_all(names=("C7",)), JUDGED))
    assert "no finite bounds" not in claim.measured


def _scattered_sac(rows):
    """SAC's seeds alternate between the target and far below it."""
    own = (rows["stage"] == "train_sac") & (rows["metric"] == "velocity")
    return rows.assign(value=rows["value"].mask(own, 0.8 - 1.2 * (rows["seed"] == 0)))


def test_measures_are_told_apart():
    units = [unit("velocity", 0.5, 0.4, 0.6, name=name) for name in ("distance lost", "success lost")]
    assert measured(units) == "distance lost: velocity 0.50 [0.40, 0.60]; success lost: velocity 0.50 [0.40, 0.60]"
