"""Table 2 (tab:combined-experiment-results): all agents on unseen tasks, both cs-rewards, metric and success."""

import pandas as pd

from mtcsirl.figures.style import look
from mtcsirl.results.published import Published, in_paper_order, load_published
from mtcsirl.results.rows import select
from mtcsirl.rewards.ground_truth import COMMON_SENSE_REWARDS
from mtcsirl.settings import Settings
from mtcsirl.study.runs import EVALUATION_TARGET
from mtcsirl.tables.cells import Cell, make_cell
from mtcsirl.tables.table import Column, Entry, Table, result_table

CAPTION = (
    "Agents on unseen tasks ({tasks}), target {target}: the metric of each cs-reward (target {targets}) and the share "
    "of successful episodes in percent. Each seed's value is the mean over the unseen tasks; ± is the standard "
    "deviation over seeds. Expert: trained on the true cs-reward; SAC: on the task reward alone; the others from "
    "scratch on the task reward and the reward that the method learned on other tasks."
)
REMARKS = (
    'The paper names its unseen tasks only in a figure that its source lacks, and does not say over what its "±" runs '
    "beyond five seeds; the prediction interval takes it as the standard deviation over seeds.",
    "A printed spread of 0 gives no prediction interval; those of the other success rates are narrower than one "
    "episode of ours: read the distance there, not inside or outside.",
    "Stochastic policies, as trained. The CSV has the means of the deterministic ones, and interquartile means over "
    "seeds x tasks with stratified bootstrap intervals; those are too short at five seeds (84 % coverage): go by the "
    "t-interval.",
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
    chosen = agent_rows(rows, settings, agent, cs_reward)
    return make_cell(chosen, metric, published.unseen(agent, cs_reward, metric))


def table_2(rows: pd.DataFrame, settings: Settings, published: Published | None = None) -> Table:
    """Build the table from ``evaluation_rows``."""
    published = published or load_published()
    columns, kinds = [], []
    for cs in in_paper_order(settings.cs_rewards):
        name = cs.replace("_", " ")
        columns += [Column(f"average {name}", name), Column("success rate (%)", name)]
        kinds += [(cs, cs, 2, 1.0), (cs, "success", 1, 100.0)]
    body = [
        (
            look(agent).label,
            [
                Entry(agent_cell(rows, settings, published, agent, cs, metric), metric, digits, factor)
                for cs, metric, digits, factor in kinds
            ],
        )
        for agent in ("expert", "sac", *settings.methods)
    ]
    caption = CAPTION.format(
        tasks=", ".join(settings.multi_task.unseen_tasks),
        target=EVALUATION_TARGET,
        targets=", ".join(f"{COMMON_SENSE_REWARDS[cs].target:g}" for cs in in_paper_order(settings.cs_rewards)),
    )
    return result_table("table_2", caption, "Agent", columns, body, settings, REMARKS)
