"""Every table of studies that leave out parts of the paper's design, with all, some and no results."""

import os
import re
import subprocess
import sys
from functools import cache

import numpy as np
import pytest

from mtcsirl.figures.heat_maps import heat_map
from mtcsirl.results.notes import of_kind
from mtcsirl.results.rows import evaluation_rows
from mtcsirl.settings import Settings
from mtcsirl.study.design import design
from mtcsirl.tables import TABLES
from mtcsirl.tables.table import Table
from tests.results.made_up import evaluation
from tests.subsets import SUBSETS, subset

# the same code as in test_tables.py and test_heat_maps.py, many times over: without coverage, in two thirds of the time
pytestmark = [pytest.mark.slow, pytest.mark.no_cover]
HEAT_MAPS = {"table_1": "action_norm", "table_3": "velocity"}
LEFT_OUT = {
    ("table_1", "velocity"): "not part of this study, cs-reward: action norm",
    ("table_3", "action_norm"): "not part of this study, cs-reward: velocity",
    ("table_2", "mt_csirl"): "not part of this study, methods: MT-AIRL, MT-VAIRL, MT-VAIRL-GP, MT-CSIRL+LT",
    ("table_2", "velocity"): "not part of this study, cs-reward: action norm",
    ("table_4", "mt_csirl"): "not part of this study, method: MT-CSIRL+LT",
    ("table_4", "action_norm"): "not part of this study, cs-reward: velocity",
    ("table_1", "tasks"): "not part of this study, tasks: reach-wall, button-press-topdown-wall, drawer-close, "
    "push-back, coffee-button",
}


@cache
def settings_of(name):
    """The settings of a subset; without a name those of the whole design."""
    return Settings(**subset(name)) if name else Settings()


@cache
def rows_of(name, table, results):
    """Rows for a table, of a subset of which all runs are there, half or none."""
    settings = settings_of(name)
    study = design(settings, table)
    if results == "none" or not [run for run in study if hasattr(run, "seed")]:
        return evaluation_rows(study, settings, partial=True)
    rows = evaluation(study, lambda agent: {}, spread=0.05)
    rows["folder"] = rows["folder"].str.replace("results/", f"{settings.results}/")
    if results == "half":
        gone = np.arange(len(rows)) % 7 < 4
        rows.loc[gone, ["value", "status"]] = [np.nan, "missing"]
    return rows


@pytest.mark.parametrize("results", ["half", "none"])
@pytest.mark.parametrize("name", SUBSETS)
@pytest.mark.parametrize("table", TABLES)
def test_no_subset_fails(table, name, results):
    made = TABLES[table](rows_of(name, table, results), settings_of(name))
    assert made.markdown().startswith("**Table ")
    assert made.latex().count(r"\begin{table}") == 1
    assert Table.from_json(made.as_json()).markdown() == made.markdown()
    if results == "none":
        assert made.is_empty == (table != "table_5")


@pytest.mark.parametrize(("table", "name"), LEFT_OUT)
def test_what_the_study_leaves_out_is_named(table, name):
    made = TABLES[table](rows_of(name, table, "none"), settings_of(name))
    assert LEFT_OUT[table, name] in [note.text for note in of_kind(made.notes, "gap")]


@pytest.mark.parametrize(("table", "name"), [("table_1", "velocity"), ("table_4", "mt_csirl")])
def test_a_table_without_any_line_says_why_in_its_place(table, name):
    made = TABLES[table](rows_of(name, table, "none"), settings_of(name))
    assert made.lines == ()
    assert f"*{LEFT_OUT[table, name]}*" in made.markdown()
    assert r"\emph{not part of this study" in made.latex()


@pytest.mark.parametrize("table", TABLES)
def test_the_whole_design_leaves_nothing_out(table):
    made = TABLES[table](rows_of("", table, "none"), settings_of(""))
    assert not [note for note in of_kind(made.notes, "gap") if "not part of this study" in note.text]


@pytest.mark.parametrize("name", SUBSETS)
@pytest.mark.parametrize("table", HEAT_MAPS)
def test_no_heat_map_fails(table, name):
    for results in ("all", "none"):
        heat_map(HEAT_MAPS[table], rows_of(name, table, results), settings_of(name)).canvas.draw()


def test_own_methods_and_cs_rewards_of_the_page_on_extending(checkout, tmp_path):
    """In a process of its own, since an extension stays in the registries."""
    page = (checkout / "docs/extending.md").read_text(encoding="utf-8")
    for file, text in re.findall(r"^`(\w+\.(?:py|yaml))`:.*?^```(?:python|yaml)\n(.*?)^```", page, re.M | re.S):
        (tmp_path / file).write_text(text, encoding="utf-8")
    (tmp_path / "run.py").write_text(
        "from mtcsirl.cli import main\n"
        "for what in (*(('table', n) for n in '12345'), ('figure', '2'), ('figure', '3'), ('figure', '6')):\n"
        "    code = main([*what, '--partial', '--config', 'mine.yaml'])\n"
        "    assert code == 0, what\n"
    )
    done = subprocess.run([sys.executable, "run.py"], cwd=tmp_path, env=os.environ, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr[-2000:]
    table = (tmp_path / "results/mine/tables/table_2.md").read_text(encoding="utf-8")
    assert "| MT-GAIL |" in table
    assert "energy, target τ = 0.5" in table
