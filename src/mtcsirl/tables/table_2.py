"""Table 2 (tab:combined-experiment-results): all agents on unseen tasks, both cs-rewards, metric and success."""

import pandas as pd

from mtcsirl.names import EVALUATION_TARGET, agent_label, distance_metric
from mtcsirl.results.notes import left_out, remarks
from mtcsirl.results.published import PAPER_ORDER, UNKNOWN, Published, in_paper_order, load_published
from mtcsirl.results.rows import select
from mtcsirl.settings import Settings
from mtcsirl.tables.cells import Cell, make_cell, unusable
from mtcsirl.tables.entries import Entry, Layout, Quantity, Row, result_table
from mtcsirl.tables.table import Table

CAPTION = (
    "Agents on unseen tasks ({tasks}), target {target}: the metric m of each cs-reward, its mean distance E|m − τ| "
    "from the target τ step by step, and the share of successful episodes in percent, ours beside the paper's. Each "
    "seed's value is the mean over the unseen tasks; ± is the standard deviation over n seeds. Expert: trained on the "
    "true cs-reward; SAC: on the task reward alone; the others from scratch on the task reward and the reward that the "
    "method learned on other tasks."
)
REMARKS = (
    'The paper names its unseen tasks only in a figure that its source lacks, and does not say over what its "±" runs '
    "beyond five seeds; the prediction interval takes it as the standard deviation over seeds.",
    "A mean at the target can hide values on both sides of it; E|m − τ| cannot. The paper does not print it.",
    "Stochastic policies, as trained. The CSV has the means of the deterministic ones, and interquartile means over "
    "seeds × tasks with stratified bootstrap intervals; those are too short at five seeds (84 % coverage): go by the "
    "t-interval.",
)
QUANTITIES = (
    Quantity("mean m"),
    Quantity("E|m − τ|", published=False, same_agents=True),
    Quantity("success (%)", digits=1, factor=100.0, same_agents=True),
)


def agent_rows(rows: pd.DataFrame, settings: Settings, agent: str, cs_reward: str) -> pd.DataFrame:
    """Evaluation rows of ``agent`` ("expert", "sac" or a method) on the unseen tasks."""
    key = {
        "expert": {"stage": "train_expert", "cs_reward": cs_reward},
        "sac": {"stage": "train_sac"},
    }.get(agent, {"stage": "transfer", "experiment": "multi_task", "method": agent, "cs_reward": cs_reward})
    return select(rows, **key, task=settings.multi_task.unseen_tasks, target=EVALUATION_TARGET)


def agent_cell(
    rows: pd.DataFrame, settings: Settings, published: Published, agent: str, cs_reward: str, metric: str
) -> Cell:
    """``metric`` of ``agent``, mean over unseen tasks per seed."""
    paper = UNKNOWN if metric.endswith("_distance") else published.unseen(agent, cs_reward, metric)
    return make_cell(agent_rows(rows, settings, agent, cs_reward), metric, paper)


def table_2(rows: pd.DataFrame, settings: Settings, published: Published | None = None) -> Table:
    """Build the table from ``evaluation_rows``: one section per cs-reward."""
    published = published or load_published()
    agents = ("expert", "sac", *settings.methods)
    sections = []
    for cs in in_paper_order(settings.cs_rewards):
        name = cs.replace("_", " ")
        columns = {cs: f"{name}: average {name}", distance_metric(cs): f"{name}: mean distance from the target",
                   "success": f"{name}: success rate (%)"}  # fmt: skip
        body = [
            Row(
                agent_label(agent),
                tuple(
                    Entry(agent_cell(rows, settings, published, agent, cs, metric), column, metric)
                    for metric, column in columns.items()
                ),
            )
            for agent in agents
        ]
        sections.append((f"{name}, target τ = {published.target(cs):g}", body))
    notes = (
        *unusable(rows),
        *left_out("methods", published.data["table_2"]["rows"], agents, label=agent_label),
        *left_out("cs-reward", PAPER_ORDER, settings.cs_rewards, label=lambda name: name.replace("_", " ")),
        *remarks(REMARKS),
    )
    caption = CAPTION.format(tasks=", ".join(settings.multi_task.unseen_tasks), target=EVALUATION_TARGET)
    return result_table("table_2", caption, Layout("Agent", QUANTITIES, tuple(sections)), settings, notes)
