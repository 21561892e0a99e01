"""Table 4 (tab:task-learned-results): new agents on both rewards that MT-CSIRL+LT learned."""

import pandas as pd

from mtcsirl.results.published import Published, in_paper_order, load_published
from mtcsirl.results.rows import select
from mtcsirl.rewards.ground_truth import COMMON_SENSE_REWARDS
from mtcsirl.settings import Settings
from mtcsirl.tables.cells import Cell, make_cell
from mtcsirl.tables.table import Column, Entry, Table, result_table

CAPTION = (
    "MT-CSIRL+LT, both rewards learned: agents from scratch on the learned task reward and the learned cs-reward, on "
    "the tasks (target {target}) whose demonstrations the IRL has seen. Ratio: metric divided by its target, closer to "
    "1 is better; success: percent of episodes."
)
REMARK = "The paper prints a spread for success alone, so only there a prediction interval exists."


def learned_task_cell(
    rows: pd.DataFrame, settings: Settings, published: Published, task: str, cs_reward: str, metric: str
) -> Cell:
    """``metric`` (the cs-reward's as a ratio to its target, or success) of new agents on ``task``."""
    key = {"stage": "transfer", "experiment": "multi_task", "method": "mt_csirl_lt", "cs_reward": cs_reward}
    chosen = select(rows, **key, task=task, target=settings.multi_task.train_targets[0])
    scale = COMMON_SENSE_REWARDS[cs_reward].target if metric == cs_reward else 1.0
    return make_cell(chosen, metric, published.learned_task(task, cs_reward, metric), scale)


def table_4(rows: pd.DataFrame, settings: Settings, published: Published | None = None) -> Table:
    """Build the table from ``evaluation_rows``."""
    published = published or load_published()
    columns, kinds = [], []
    for cs in in_paper_order(settings.cs_rewards) if "mt_csirl_lt" in settings.methods else ():
        name = cs.replace("_", " ")
        columns += [Column(f"{name} ratio", name), Column("success rate (%)", name)]
        kinds += [(cs, cs, 2, 1.0), (cs, "success", 1, 100.0)]
    body = [
        (
            task,
            [
                Entry(learned_task_cell(rows, settings, published, task, cs, metric), metric, digits, factor)
                for cs, metric, digits, factor in kinds
            ],
        )
        for task in settings.multi_task.train_tasks
    ]
    caption = CAPTION.format(target=settings.multi_task.train_targets[0])
    return result_table("table_4", caption, "Task", columns, body, settings, [REMARK])
