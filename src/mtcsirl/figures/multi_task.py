"""Shared by Figures 3 and 7: the reward learned from several tasks, on unseen tasks (section 5.3)."""

from mtcsirl.figures.curves import Series
from mtcsirl.figures.data import FigureData, rows_where
from mtcsirl.figures.scatter import Correlation, select_correlation
from mtcsirl.figures.style import LOOKS
from mtcsirl.names import EVALUATION_TARGET
from mtcsirl.study.design import design

EXPERIMENT, METHOD, SOURCE = "multi_task", "mt_csirl", "all"


def curve_series(data: FigureData, metric: str, shown: str = "") -> list[Series]:
    """Expert, MT-CSIRL (transferred) and SAC on the unseen tasks, for the cs-reward ``metric``.

    ``shown``: another metric of the same agents.
    """
    study = design(data.settings, "figure_3")
    tasks = data.settings.multi_task.unseen_tasks
    here = {"target": EVALUATION_TARGET, "metric": shown or metric, "task": tasks}
    reward = {"experiment": EXPERIMENT, "method": METHOD, "cs_reward": metric, "source": SOURCE}
    experts = [run for run in study.experts if run.cs_reward == metric and run.target == EVALUATION_TARGET]
    transfers = [run for run in study.transfers if run.irl.cs_reward == metric]
    return [
        Series(
            "Expert",
            LOOKS["expert"],
            rows_where(data.curves, here | {"stage": "train_expert", "cs_reward": metric}),
            tuple((run.task, run.seed) for run in experts if run.task in tasks),
        ),
        Series(
            LOOKS[METHOD].label,
            LOOKS[METHOD],
            rows_where(data.curves, here | reward | {"stage": "transfer"}),
            tuple((run.task, run.seed) for run in transfers),
        ),
        Series(
            "SAC",
            LOOKS["sac"],
            rows_where(data.curves, here | {"stage": "train_sac"}),
            tuple((run.task, run.seed) for run in study.baselines if run.task in tasks),
        ),
    ]


def correlation(data: FigureData, cs_reward: str) -> Correlation:
    """The multi-task reward against the truth on the first unseen task."""
    task = data.settings.multi_task.unseen_tasks[0]
    return select_correlation(data, experiment=EXPERIMENT, method=METHOD, cs_reward=cs_reward, source=SOURCE, task=task)
