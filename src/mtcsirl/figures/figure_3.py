"""Figure 3: ground-truth cs-reward on unseen tasks; (a) action norm, (b) velocity, (c) correlation for velocity."""

from matplotlib.figure import Figure

from mtcsirl.figures import multi_task
from mtcsirl.figures.curves import add_legend, counts, curve_panel
from mtcsirl.figures.data import FigureData
from mtcsirl.figures.scatter import draw_scatter, scatter_caption
from mtcsirl.figures.style import (
    TEXT_WIDTH,
    add_notes,
    letter,
    new_figure,
    panel_title,
    quantity,
    scale_notes,
    styled,
)

TITLE = "Ground-truth cs-reward on unseen tasks"
_SCATTER = "velocity"


@styled
def draw(data: FigureData) -> Figure:
    """Learning curves of Expert, MT-CSIRL (transferred) and SAC, mean over the unseen tasks, and the scatter."""
    metrics = data.cs_rewards
    figure = new_figure(TEXT_WIDTH, 2.35)
    axes = figure.subplots(1, len(metrics) + 1, squeeze=False)[0]
    notes: list[str] = []
    for index, metric in enumerate(metrics):
        series, success = (multi_task.curve_series(data, metric, shown) for shown in ("", "success"))
        notes += curve_panel(axes[index], index, metric, series, success)
    panel_title(axes[-1], len(metrics), "Rewards' correlation")
    draw_scatter(axes[-1], multi_task.correlation(data, _SCATTER), multi_task.METHOD, _SCATTER)
    unseen = data.settings.multi_task.unseen_tasks
    add_legend(figure, list(axes[:-1]), f"{'mean over ' if len(unseen) > 1 else ''}{', '.join(unseen)}")
    add_notes(figure, notes + scale_notes(data.settings.scale))
    return figure


def caption(data: FigureData) -> str:
    """What the figure shows."""
    metrics = data.cs_rewards
    letters = ", ".join(f"({letter(index)}) {quantity(metric)}" for index, metric in enumerate(metrics))
    numbers = "; ".join(f"{quantity(metric)}: {counts(multi_task.curve_series(data, metric))}" for metric in metrics)
    found = multi_task.correlation(data, _SCATTER)
    return (
        f"{_tasks(data.settings.multi_task.unseen_tasks)} "
        f"{letters}: Expert maximises r_task and the true cs-reward, MT-CSIRL r_task and the reward "
        f"learned from {', '.join(data.settings.multi_task.train_tasks)}, SAC r_task alone; training episodes of the "
        "stochastic policy. Red line: target. Lines and bands: mean and 95 % t-interval over seeds "
        f"({numbers}); bands are cut off at the frame. Tasks have budgets of their own, so that where these differ the "
        "horizontal axis is the share of each agent's own steps. Success below the panels: of training episodes; "
        "tables have that of evaluation episodes. "
        f"({letter(len(metrics))}) {scatter_caption(found, _SCATTER)}"
    )


def _tasks(unseen: tuple[str, ...]) -> str:
    if len(unseen) == 1:
        return f"The task {unseen[0]}, which IRL has not seen."
    return (
        f"Tasks that IRL has not seen ({', '.join(unseen)}), mean over them; a series that lacks runs is the mean over "
        'those that are there. The paper\'s figure shows "the unseen test task", one that it does not name.'
    )
