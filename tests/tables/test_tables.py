import json
import shutil
import subprocess

import numpy as np
import pytest

from mtcsirl.errors import UserError
from mtcsirl.results.notes import KINDS, Note, of_kind
from mtcsirl.results.rows import select
from mtcsirl.settings import Settings
from mtcsirl.study.design import design
from mtcsirl.tables import TABLES
from mtcsirl.tables.grid import Column, Grid, Line
from mtcsirl.tables.table import Table
from tests.results.made_up import evaluation

SETTINGS = Settings(
    methods=("mt_airl", "mt_vairl", "mt_csirl", "mt_csirl_lt"),
    sac={"minibatch": 128, "discount": 0.99, "hidden_sizes": (256, 256)},
    multi_target={"tasks": ("reach-wall", "push-back"), "train_targets": (1, 2)},
    multi_task={
        "train_tasks": ("reach", "door-close"),
        "train_targets": (1,),
        "unseen_tasks": ("reach-wall", "push-back"),
    },
)
RESULT_TABLES = ("table_1", "table_2", "table_3", "table_4")


def means(agent):
    """Experts and MT-CSIRL reach their targets; MT-AIRL fails; diagonal 0.72 m/s, off it 0.4 m/s."""
    if agent["stage"] == "train_expert" or agent["method"].startswith("mt_csirl"):
        near = agent["experiment"] != "multi_target" or agent["source"] == agent["task"]
        return {"velocity": 0.72 if near else 0.4, "action_norm": 2.7 if near else 1.8}
    if agent["method"].startswith("mt_"):
        return {"velocity": 0.1, "action_norm": 1.3, "success": 0.6}
    return {"velocity": 0.32, "action_norm": 1.57}


@pytest.fixture(scope="module")
def rows():
    return {name: evaluation(design(SETTINGS, name), means, spread=0.05) for name in RESULT_TABLES}


@pytest.fixture(scope="module")
def tables(rows):
    return {name: build(rows.get(name), SETTINGS) for name, build in TABLES.items()}


@pytest.mark.parametrize("name", RESULT_TABLES)
def test_every_cell_has_our_number_and_the_papers(tables, name):
    numbers = tables[name].csv()
    expected = {"table_1": 2 * 2 + 2, "table_3": 2 * 2 + 2, "table_2": 2 * 6 * 3, "table_4": 2 * 4}[name]
    assert len(numbers) == expected
    assert numbers["n"].eq(5).all()
    assert numbers[["mean", "std", "low", "high"]].notna().all(axis=None)
    assert (numbers["paper_mean"].isna() == numbers["metric"].str.endswith("_distance")).all(), "the paper has none"
    assert (numbers["low"] < numbers["mean"]).sum() >= numbers["std"].gt(0).sum()


def test_table_1_and_3_have_diagonal_bold_and_the_baseline_last(tables):
    for name, cs_target, near, far in (("table_1", 3.0, 2.7, 1.8), ("table_3", 0.8, 0.72, 0.4)):
        numbers = tables[name].csv().set_index(["row", "column"])["mean"]
        assert numbers["reach-wall", "reach-wall"] == pytest.approx(near / cs_target, rel=0.05)
        assert numbers["reach-wall", "push-back"] == pytest.approx(far / cs_target, rel=0.05)
        assert [line.strong for line in tables[name].lines] == [(0,), (2,), ()]
        assert tables[name].lines[-1].label == "SAC (task reward alone)"
        assert set(tables[name].csv()["in_prediction"]) == {"uninformative"}, "the paper prints no spread"
        assert "?" not in tables[name].markdown().split("\n\n")[1], "said once, in a remark, not in every cell"


@pytest.mark.parametrize("name", ["table_1", "table_3"])
def test_the_caption_names_the_method_that_learned(rows, tables, name):
    assert "MT-CSIRL learned the reward; " in tables[name].caption
    assert tables[name].caption.endswith("and the paper's mean.")
    chosen = SETTINGS.multi_target.model_copy(update={"method": "mt_airl"})
    other = TABLES[name](rows[name], SETTINGS.model_copy(update={"multi_target": chosen}))
    assert "MT-AIRL learned the reward; " in other.caption
    assert other.caption.endswith("and the paper's mean, that of MT-CSIRL.")


def test_table_2_says_who_falls_inside_the_papers_interval(tables):
    numbers = tables["table_2"].csv().set_index(["row", "column"])
    assert numbers.loc[("MT-CSIRL", "velocity: average velocity"), "in_prediction"] == "inside"
    assert numbers.loc[("MT-VAIRL", "action norm: average action norm"), "in_prediction"] == "outside"
    assert numbers.loc[("SAC", "action norm: average action norm"), "in_prediction"] == "uninformative"
    texts = {line.label: line.texts for line in tables["table_2"].lines[8:]}
    assert texts["MT-CSIRL"][0].endswith("(n=5) ∈")
    assert texts["MT-CSIRL"][1] == "0.73±0.07", "the paper's beside ours"
    airl = numbers.loc[("MT-AIRL", "action norm: success rate (%)")]
    assert airl["mean"] == pytest.approx(0.6, abs=0.03)
    assert airl["paper_mean"] == pytest.approx(0.635)


def test_table_4_reads_agents_with_a_learned_task_reward(rows, tables):
    numbers = tables["table_4"].csv().set_index(["row", "column"])["mean"]
    assert numbers["door-close", "action norm: action norm ratio"] == pytest.approx(0.9, abs=0.05)
    assert set(select(rows["table_4"], stage="transfer")["target"]) == {SETTINGS.multi_task.train_targets[0]}


def test_table_5_names_what_differs(tables):
    numbers = tables["table_5"].csv().set_index("row")
    assert numbers.loc["Discount factor", "same"] == "yes"
    assert numbers.loc["Batch size (transitions per gradient step)", ["ours", "paper", "same"]].tolist() == [
        "128",
        "500",
        "no",
    ]
    assert numbers.loc["Policy hidden sizes", "paper"] == "(256, 256)"


@pytest.mark.parametrize("name", TABLES)
def test_scale_and_deviations_stand_under_every_table(tables, name):
    notes = tables[name].notes
    assert notes[0].kind == "scale"
    assert notes[0].text.startswith("scale desk; 5 seeds")
    (minibatch,) = [note for note in of_kind(notes, "deviation") if "sac.minibatch = 128" in note.text]
    assert minibatch.short == "sac.minibatch = 128 transitions (500)"
    assert minibatch.text in tables[name].markdown()
    assert "sac.minibatch" not in tables[name].brief(), "a page of several tables says it once"


@pytest.mark.parametrize("name", TABLES)
def test_smoke_tables_say_that_they_mean_nothing(rows, name):
    table = TABLES[name](rows.get(name), SETTINGS.model_copy(update={"scale": "smoke"}))
    assert "smoke scale: numbers mean nothing" in table.markdown()
    assert "smoke scale: numbers mean nothing" in table.latex()
    assert set(table.csv()["scale"]) == {"smoke"}


def test_missing_cells_are_marked_and_explained(rows):
    holes = rows["table_2"].copy()
    gone = (holes["method"] == "mt_csirl") & (holes["seed"] >= 3) & (holes["task"] == "push-back")
    holes.loc[gone, ["value", "status"]] = [np.nan, "missing"]
    table = TABLES["table_2"](holes, SETTINGS)
    text = table.markdown()
    found = [line for line in text.splitlines() if line.startswith("| MT-CSIRL |")][:2]
    assert all(line.count("(n=3)") == 3 and line.count("‡2") == 1 for line in found), "a mark stands once per agent"
    assert "‡ missing agents" in text
    assert next(note.text for note in of_kind(table.notes, "gap")) == "incomplete: 6 of 36 cells lack seeds"


def test_what_an_unusable_run_lacks_is_named(rows):
    frame = rows["table_2"].copy()
    gone = (frame["stage"] == "train_sac") & (frame["task"] == "push-back") & (frame["seed"] == 1)
    frame.loc[gone, ["value", "status", "lacks"]] = [np.nan, "incomplete", "stochastic velocity: 9 of 10 episodes"]
    table = TABLES["table_2"](frame, SETTINGS)
    gaps = [note.text for note in of_kind(table.notes, "gap")]
    assert "results/sac/push-back-t0/s1: stochastic velocity: 9 of 10 episodes" in gaps
    assert next(line for line in table.lines if line.label == "SAC").texts[0].endswith("(n=4) ? ¶1")
    frame.loc[frame["stage"] == "train_sac", ["value", "status", "lacks"]] = [
        np.nan,
        "stale",
        "sac.discount 0.9, not 0.97",
    ]
    many = [note.text for note in of_kind(TABLES["table_2"](frame, SETTINGS).notes, "gap")]
    assert sum("sac.discount" in text for text in many) == 3
    assert "and 7 more runs: mtcsirl status" in many


def test_distance_from_the_target_is_shown_where_it_was_recorded(rows):
    frame = rows["table_2"]
    frame = frame[frame["metric"] != "action_norm_distance"]
    frame = frame.assign(value=frame["value"].where(frame["metric"] != "velocity_distance", 0.125))
    table = TABLES["table_2"](frame, SETTINGS)
    sections = {head.label: body for head, body in table.grid.sections}
    assert {line.texts[2] for line in sections["velocity, target τ = 0.8"]} == {"0.12±0.00 (n=5)"}
    assert {line.texts[2] for line in sections["action norm, target τ = 3"]} == {"–"}
    numbers = table.csv().query("metric == 'velocity_distance'")
    assert numbers["mean"].eq(0.125).all()
    assert set(numbers["agents_missing"]) == {0}


def test_own_method_gets_its_row(rows):
    """A method of one's own appears under its name, without a number of the paper's."""
    own = rows["table_2"].copy()
    own.loc[own["method"] == "mt_vairl", "method"] = "my_gail"
    settings = SETTINGS.model_copy(update={"methods": ("my_gail",)})
    numbers = TABLES["table_2"](own, settings).csv().set_index("row")
    assert numbers.loc["MY-GAIL", "paper_mean"].isna().all()
    assert numbers.loc["MY-GAIL"]["mean"].notna().all()


def test_markdown_is_a_table_and_its_intervals(tables):
    lines = [line.replace("\\|", "") for line in tables["table_2"].markdown().splitlines() if line.startswith("|")]
    assert {line.count("|") for line in lines} == {7}
    assert len(lines) == 2 * (2 + 2 * (1 + 6)), "twice: heading and rule; per cs-reward its name and six agents"
    assert lines[0] == "| Agent | mean m, ours | paper | Em − τ | success (%), ours | paper |"


def test_one_line_per_agent(tables):
    grid = tables["table_2"].grid
    assert [head.label.split(",")[0] for head, _ in grid.sections] == ["action norm", "velocity"]
    assert [len(body) for _, body in grid.sections] == [6, 6]


def test_special_characters_survive_both_forms():
    grid = Grid("x", (Column("c_d"),), (Line("e|f", ("1±2 ∈ †3",)),))
    table = Table("table_9", "50 % of x_y", grid, (Note("remark", "#1"),))
    assert r"50 \% of x\_y" in table.latex()
    assert r"1$\pm$2 $\in$ $^{\dagger}$3" in table.latex()
    assert r"\#1\par" in table.latex()
    assert r"e\|f" in table.markdown()


def test_latex_knows_every_sign_that_tables_print(tables):
    for table in tables.values():
        assert table.latex().isascii()


@pytest.mark.parametrize("name", TABLES)
def test_the_report_gets_the_table_as_data(tables, name):
    data = json.loads(json.dumps(tables[name].as_json(), allow_nan=False))
    assert {"columns", "lines", "notes"} <= set(data)
    again = Table.from_json(data)
    assert again.markdown() == tables[name].markdown()
    assert again.latex() == tables[name].latex()
    assert again.grid == tables[name].grid


@pytest.mark.parametrize("wrong", [[], {}, "text", None, {"name": "table_1"}])
def test_foreign_data_is_named(wrong):
    with pytest.raises(UserError, match=r"table_9\.json: not a table of this suite"):
        Table.from_json(wrong, "table_9.json")


@pytest.mark.parametrize("change", ["kind", "texts"])
def test_a_table_that_was_tampered_with_is_named(tables, change):
    data = tables["table_1"].as_json()
    if change == "kind":
        data["notes"][0]["kind"] = "rumour"
    else:
        data["lines"][0]["texts"].pop()
    with pytest.raises(UserError, match="rumour" if change == "kind" else "as many texts"):
        Table.from_json(data)


def test_notes_are_rendered_by_kind(tables):
    assert {note.kind for table in tables.values() for note in table.notes} == set(KINDS)
    for table in tables.values():
        text, brief = table.markdown(), table.brief()
        for note in table.notes:
            assert note.text.replace("|", "\\|") in text
            assert (note.text.replace("|", "\\|") in brief) == (note.kind not in ("scale", "deviation"))


@pytest.mark.skipif(shutil.which("pdflatex") is None, reason="pdflatex is not installed")
def test_latex_compiles_with_booktabs(tables, tmp_path):
    head = "\\documentclass{article}\n\\usepackage{booktabs,graphicx}\n\\begin{document}\n"
    body = "\\clearpage\n".join(table.latex() for table in tables.values())
    (tmp_path / "tables.tex").write_text(head + body + "\\end{document}\n", encoding="utf-8")
    command = ["pdflatex", "-interaction=nonstopmode", "-halt-on-error", "tables.tex"]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout[-2000:]
    assert (tmp_path / "tables.pdf").stat().st_size > 10_000
    assert "too large" not in done.stdout, "a table runs off its page"
    assert "Overfull" not in done.stdout
