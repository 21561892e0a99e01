"""A made-up page: every section filled, awkward characters included."""

from dataclasses import replace
from functools import cache

from mtcsirl.figures.style import figure_bytes, new_figure
from mtcsirl.report.content import (
    Claim,
    DeviationLine,
    FigureView,
    GateLine,
    ReportData,
    StageCost,
    TableView,
    TargetLine,
    UnitLine,
    WhatWasRun,
)
from mtcsirl.results.notes import Note
from mtcsirl.study.design import ARTEFACTS
from mtcsirl.tables.grid import Column, Grid, Line
from mtcsirl.tables.table import Table

FIGURES = [name for name in ARTEFACTS if name.startswith("figure_")]
VERDICTS = ("reproduced", "partially", "not reproduced", "inconclusive", "precondition not met", "not run")
TASKS = ("reach-wall", "button-press-topdown-wall", "drawer-close", "push-back", "coffee-button")
UNIT = {
    "unit": "velocity, reach-wall",
    "judged": "met",
    "paper": "0.81±0.02",
    "ours": "0.79±0.03, n=5, success 100 %",
    "measure": "distance to the target / target: 0.03 [0.01, 0.05]; paper 0.01",
    "ours_in_prediction": "yes [0.77, 0.85]",
    "paper_in_interval": "yes [0.75, 0.83]",
    "difference": "SAC: yes, +0.47 [0.41, 0.53], p < 0.001",
    "effect": "12.1 [6.0, 18.2]; closer with probability 1.00",
    "why": "distance to the target at most 0.15: met; success at least 0.9: met",
    "notes": "E|m - tau| of single steps 0.09±0.01; |E m - tau| 0.02",
}


TRANSFERS = "transfer/multi_target/mt_csirl/velocity/reach-wall/reach-wall-t0"
EXPERTS = ("expert/velocity/reach-wall-t0/s0", "sac/reach-wall-t0/s0")
REMARKS = ("power 52 % at these spreads and seeds, were both equal", "a <note>")
UNITS = (
    UnitLine(UNIT, "met", "like SAC", 0.03, REMARKS, folders=EXPERTS),
    UnitLine(UNIT | {"unit": "velocity, all of them"}, "not judged", value=0.1, judged=False),
)
DEPARTURES = (("for", "settings were chosen until <it> passed"), ("against", "another thing"))


def made_up_report(scale: str = "desk", **changes) -> ReportData:
    data = ReportData(
        run=WhatWasRun(
            scale=scale,
            seeds=(0, 1, 2, 3, 4),
            commits=("0123456789abcdef0123456789abcdef01234567",),
            machines=("Some Processor 9000 @ 2.50GHz, 2 cores, Linux-6.1, Python 3.11.7",),
            versions={"metaworld": "3.1.1", "torch": "2.13.0"},
            stages=(
                StageCost("train_expert", 120, 130, 30_600.0, 612.0),
                StageCost("train_sac", 50, 50, 11_700.0, 590.4),
            ),
        ),
        claims=tuple(
            Claim(
                f"C{number + 1}",
                "Experts trained on task and ground-truth cs-reward reach both targets with <full> success.",
                "Table 2, row Expert",
                "mean distance to the target at most 15 % & mean success at least 90 %",
                VERDICTS[number % len(VERDICTS)],
                "1 met of 1 units",
                UNITS,
                "distance to the target / target: velocity 0.03 [0.01, 0.05], action norm 0.02 [0.01, 0.04]",
                gate=number == 0,
                departures=DEPARTURES if number == 0 else (),
            )
            for number in range(12)
        ),
        tables=(
            TableView("table_1", "one learned, all tried", _table(), (("its rows (CSV)", "../tables/table_1.csv"),)),
        ),
        figures=tuple(_figure(name) for name in FIGURES),
        gates=(
            GateLine("expert", "reach-wall", "velocity", 5, 5, 1.0, 0.79, EXPERTS),
            GateLine("SAC", "push-back", "", 0, 5, 0.4, None),
            GateLine("transfer agent, multi task, mt csirl", "drawer-close", "action_norm", 3, 5, 0.92, 2.7),
        ),
        deviations=(
            DeviationLine("sac.minibatch", "128 transitions", "500", "transitions per gradient step"),
            DeviationLine("irl.schedule", "batched", "as_printed", "loop over tasks as printed, or one tensor program"),
        ),
        targets=tuple(TargetLine(name, f"makes {name}", 3, 4, 5400.0) for name in (*ARTEFACTS, "claims", "all")),
        rows={f"{TRANSFERS}/s0": f"../{TRANSFERS}/s0/evaluation.csv"},
        beforehand="Thresholds were fixed before; settings were not.",
    )
    return replace(data, **changes)


def _table() -> Table:
    columns = tuple(Column(title, task) for task in TASKS for title in ("ours", "paper"))
    lines = [Line("velocity, target τ = 0.8", section=True)]
    for number, task in enumerate(TASKS):
        texts = [text for i in range(5) for text in (f"0.{9 - abs(i - number)}1±0.03 (n=5) ∈ †1", "0.91±0.02")]
        folders = {} if number else {0: (f"{TRANSFERS}/s0", f"{TRANSFERS}/s1")}
        lines.append(Line(task, tuple(texts), rule=number == 4, strong=(2 * number,), folders=folders))
    intervals = Grid("learned on", (Column("ours", "reach-wall"),), tuple(Line(t, ("[0.87, 0.95]",)) for t in TASKS))
    notes = (
        Note("scale", "scale desk; 5 seeds (0, 1, 2, 3, 4)"),
        Note("gap", "incomplete: 1 of 30 cells lack seeds"),
        Note("mark", "† agents below their gate; they count in the mean"),
        Note("remark", "The paper prints no spread."),
        Note("deviation", "sac.minibatch = 128 transitions (paper: 500): transitions per gradient step", "short"),
    )
    grid = Grid("learned on", columns, tuple(lines))
    return Table("table_1", "Ratio to the target; rows: where the reward was learned.", grid, notes, intervals)


@cache
def _figure(name):
    figure = new_figure(3, 1.5)
    figure.subplots().plot([0, 1], [0, 1])
    return FigureView(name, f"what {name} shows", "Mean and 95 % t-interval, n = 5 seeds.", figure_bytes(figure, "png"))
