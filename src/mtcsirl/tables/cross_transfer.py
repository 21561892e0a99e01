"""Tables 1 and 3: the reward learned on several targets of one task, tried on a new target of every task."""

import pandas as pd

from mtcsirl.names import EVALUATION_TARGET, agent_label
from mtcsirl.results.notes import left_out, remarks
from mtcsirl.results.published import RATIO_TABLES, Published
from mtcsirl.results.rows import select
from mtcsirl.rewards.ground_truth import COMMON_SENSE_REWARDS
from mtcsirl.settings import Settings
from mtcsirl.tables.cells import Cell, make_cell, unusable
from mtcsirl.tables.entries import Entry, Layout, Quantity, Row, result_table
from mtcsirl.tables.table import Table

BASELINE = "SAC (task reward alone)"
PAPERS = "mt_csirl"
"""The method of the paper's numbers."""
REMARK = "The paper prints no spread for this table, so there is no prediction interval to fall inside."


def transfer_cell(rows: pd.DataFrame, published: Published, cs_reward: str, source: str, task: str) -> Cell:
    """metric / target of new agents on ``task`` with the reward of ``source``."""
    key = {"stage": "transfer", "experiment": "multi_target", "cs_reward": cs_reward}
    chosen = select(rows, **key, source=source, task=task, target=EVALUATION_TARGET)
    paper = published.cross_transfer(cs_reward, source, task)
    return make_cell(chosen, cs_reward, paper, COMMON_SENSE_REWARDS[cs_reward].target)


def baseline_cell(rows: pd.DataFrame, published: Published, cs_reward: str, task: str) -> Cell:
    """metric / target of plain SAC on ``task``."""
    chosen = select(rows, stage="train_sac", task=task, target=EVALUATION_TARGET)
    paper = published.cross_baseline(cs_reward, task)
    return make_cell(chosen, cs_reward, paper, COMMON_SENSE_REWARDS[cs_reward].target)


def cross_transfer_table(
    name: str, cs_reward: str, rows: pd.DataFrame, settings: Settings, published: Published
) -> Table:
    """Sources x tasks, the diagonal bold, plain SAC in the last row (the paper has it in parentheses).

    A study without the cs-reward has no rows here, and the table says so.
    """
    tasks = settings.multi_target.tasks
    cells = {
        source: [transfer_cell(rows, published, cs_reward, source, task) for task in tasks] for source in tasks
    } | {BASELINE: [baseline_cell(rows, published, cs_reward, task) for task in tasks]}
    body = [
        Row(
            label,
            tuple(Entry(cell, task, cs_reward, strong=task == label) for task, cell in zip(tasks, own, strict=True)),
            rule=label == BASELINE,
        )
        for label, own in cells.items()
    ]
    layout = Layout(
        "reward learned on",
        tuple(Quantity(task, usual=len(settings.seeds)) for task in tasks),
        (("", body),) if cs_reward in settings.cs_rewards else (),
    )
    papers = published.data[RATIO_TABLES[cs_reward]]["tasks"]
    notes = (
        *unusable(rows),
        *left_out("cs-reward", [cs_reward], settings.cs_rewards, label=_words),
        *left_out("tasks", papers, tasks),
        *remarks([REMARK]),
    )
    caption = _caption(cs_reward, COMMON_SENSE_REWARDS[cs_reward].target, settings)
    return result_table(name, caption, layout, settings, notes)


def _caption(cs_reward: str, target: float, settings: Settings) -> str:
    quantity = _words(cs_reward)
    seen = settings.multi_target.train_targets
    method, papers = agent_label(settings.multi_target.method), agent_label(PAPERS)
    whose = "" if method == papers else f", that of {papers}"
    new = "which is among them" if EVALUATION_TARGET in seen else "not among them"
    return (
        f"{quantity.capitalize()} cs-reward, several targets: {quantity} of a new agent divided by its target "
        f"({target:g}); closer to 1 is better. Rows: the task on whose {_targets(seen)} {method} learned the "
        "reward; "
        f"columns: the task on whose target {EVALUATION_TARGET}, {new}, a new agent was trained and evaluated. "
        f"Mean±std over n = {len(settings.seeds)} seeds where no other n is printed, and the paper's mean{whose}."
    )


def _words(name: str) -> str:
    return name.replace("_", " ")


def _targets(targets: tuple[int, ...]) -> str:
    return f"target{'s' if len(targets) > 1 else ''} {', '.join(map(str, targets))}"
