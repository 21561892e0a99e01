"""Table 4 (tab:task-learned-results): new agents on both rewards that MT-CSIRL+LT learned."""

import pandas as pd

from mtcsirl.names import agent_label
from mtcsirl.results.notes import left_out, remarks
from mtcsirl.results.published import PAPER_ORDER, Published, in_paper_order, load_published
from mtcsirl.results.rows import select
from mtcsirl.settings import Settings
from mtcsirl.tables.cells import Cell, make_cell, unusable
from mtcsirl.tables.entries import Entry, Layout, Quantity, Row, result_table
from mtcsirl.tables.table import Table

CAPTION = (
    "MT-CSIRL+LT, both rewards learned: agents from scratch on the learned task reward and the learned cs-reward, on "
    "the tasks (target {target}) whose demonstrations the IRL has seen. Ratio: metric divided by its target, closer to "
    "1 is better; success: percent of episodes. Mean±std over n seeds, ours beside the paper's."
)
REMARK = "The paper prints a spread for success alone, so only there a prediction interval exists."
QUANTITIES = (
    Quantity("ratio to the target"),
    Quantity("success (%)", digits=1, factor=100.0, same_agents=True),
)


def learned_task_cell(
    rows: pd.DataFrame, settings: Settings, published: Published, task: str, cs_reward: str, metric: str
) -> Cell:
    """``metric`` (the cs-reward's as a ratio to its target, or success) of new agents on ``task``."""
    key = {"stage": "transfer", "experiment": "multi_task", "method": "mt_csirl_lt", "cs_reward": cs_reward}
    chosen = select(rows, **key, task=task, target=settings.multi_task.train_targets[0])
    scale = published.target(cs_reward) if metric == cs_reward else 1.0
    return make_cell(chosen, metric, published.learned_task(task, cs_reward, metric), scale)


def table_4(rows: pd.DataFrame, settings: Settings, published: Published | None = None) -> Table:
    """Build the table from ``evaluation_rows``: one section per cs-reward; none without MT-CSIRL+LT."""
    published = published or load_published()
    sections = []
    for cs in in_paper_order(settings.cs_rewards) if "mt_csirl_lt" in settings.methods else ():
        name = cs.replace("_", " ")
        columns = {cs: f"{name}: {name} ratio", "success": f"{name}: success rate (%)"}
        body = [
            Row(
                task,
                tuple(
                    Entry(learned_task_cell(rows, settings, published, task, cs, metric), column, metric)
                    for metric, column in columns.items()
                ),
            )
            for task in settings.multi_task.train_tasks
        ]
        sections.append((f"{name}, target {published.target(cs):g}", body))
    notes = (
        *unusable(rows),
        *left_out("method", ["mt_csirl_lt"], settings.methods, label=agent_label),
        *left_out("tasks", published.data["table_4"]["rows"], settings.multi_task.train_tasks),
        *left_out("cs-reward", PAPER_ORDER, settings.cs_rewards, label=lambda name: name.replace("_", " ")),
        *remarks([REMARK]),
    )
    caption = CAPTION.format(target=settings.multi_task.train_targets[0])
    return result_table("table_4", caption, Layout("Task", QUANTITIES, tuple(sections)), settings, notes)
