"""Tables 1 and 3: the reward learned on several targets of one task, tried on a new target of every task."""

import pandas as pd

from mtcsirl.results.published import Published
from mtcsirl.results.rows import select
from mtcsirl.rewards.ground_truth import COMMON_SENSE_REWARDS
from mtcsirl.settings import Settings
from mtcsirl.study.runs import EVALUATION_TARGET
from mtcsirl.tables.cells import Cell, make_cell
from mtcsirl.tables.table import Column, Entry, Table, result_table

BASELINE = "SAC (task reward alone)"


def transfer_cell(rows: pd.DataFrame, published: Published, cs_reward: str, source: str, task: str) -> Cell:
    """metric / target of new agents on ``task`` with the reward of ``source``."""
    key = {"stage": "transfer", "experiment": "multi_target", "method": "mt_csirl", "cs_reward": cs_reward}
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
    """Sources x tasks, the diagonal bold, plain SAC in the last row (the paper has it in parentheses)."""
    tasks = settings.multi_target.tasks if cs_reward in settings.cs_rewards else ()
    cells = {source: [transfer_cell(rows, published, cs_reward, source, task) for task in tasks] for source in tasks}
    body = [
        (source, [Entry(cell, cs_reward, strong=task == source) for task, cell in zip(tasks, row, strict=True)])
        for source, row in cells.items()
    ]
    body.append((BASELINE, [Entry(baseline_cell(rows, published, cs_reward, task), cs_reward) for task in tasks]))
    quantity = cs_reward.replace("_", " ")
    caption = (
        f"{quantity.capitalize()} cs-reward, several targets: {quantity} of a new agent divided by its target "
        f"({COMMON_SENSE_REWARDS[cs_reward].target:g}); closer to 1 is better. Rows: the task on whose targets "
        f"{', '.join(map(str, settings.multi_target.train_targets))} MT-CSIRL learned the reward; columns: the task on "
        f"whose target {EVALUATION_TARGET}, not among them, a new agent was trained and evaluated."
    )
    remark = "The paper prints no spread for this table, so there is no prediction interval to fall inside."
    return result_table(name, caption, "reward learned on", [Column(task) for task in tasks], body, settings, [remark])
