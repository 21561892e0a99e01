"""Figures 2, 4, 5, S1 and S2: one task, one target, one learned reward (section 5.1)."""

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from mtcsirl.figures.curves import Series, add_legend, counts, curve_panel
from mtcsirl.figures.data import FigureData, rows_where
from mtcsirl.figures.scatter import Correlation, draw_scatter, scatter_caption, select_correlation
from mtcsirl.figures.style import (
    LOOKS,
    TEXT_WIDTH,
    add_notes,
    letter,
    look,
    new_figure,
    panel_title,
    quantity,
    scale_notes,
    styled,
)
from mtcsirl.names import EVALUATION_TARGET, agent_label
from mtcsirl.settings.runs import irl_run
from mtcsirl.study.design import design

EXPERIMENT = "single_target"
SCATTER_CS_REWARD = "velocity"


def curve_series(data: FigureData, artefact: str, task: str, metric: str, shown: str = "") -> list[Series]:
    """IRL agent, Transferred and SAC on ``task``, with the runs that ``artefact`` asks for.

    ``metric``: the cs-reward that they are about; ``shown``: another metric of the same agents.
    """
    study = design(data.settings, artefact)
    here = {"task": task, "target": EVALUATION_TARGET, "metric": shown or metric}
    reward = {"experiment": EXPERIMENT, "cs_reward": metric, "source": task}
    transfers = [run for run in study.transfers if run.irl.cs_reward == metric and run.irl.experiment == EXPERIMENT]
    runs = [run for run in study.irl_runs if run.cs_reward == metric and run.source == task]
    baselines = [run for run in study.baselines if run.task == task]
    return [
        Series(
            "IRL agent",
            LOOKS["irl_agent"],
            rows_where(data.curves, here | reward | {"stage": "learn_reward"}),
            tuple((task, run.seed) for run in runs if run.experiment == EXPERIMENT),
        ),
        Series(
            "Transferred",
            look(data.settings.single_target.method),
            rows_where(data.curves, here | reward | {"stage": "transfer"}),
            tuple((run.task, run.seed) for run in transfers),
        ),
        Series(
            "SAC",
            LOOKS["sac"],
            rows_where(data.curves, here | {"stage": "train_sac"}),
            tuple((run.task, run.seed) for run in baselines),
        ),
    ]


def correlation(data: FigureData, task: str, cs_reward: str) -> Correlation:
    """The single-target reward of ``task`` against the truth."""
    return select_correlation(
        data,
        experiment=EXPERIMENT,
        method=data.settings.single_target.method,
        cs_reward=cs_reward,
        source=task,
        task=task,
    )


@styled
def draw(data: FigureData, artefact: str, task: str, metrics: list[str], *, scatter: bool = False) -> Figure:
    """One panel of learning curves per cs-reward in ``metrics``, and the scatter if asked for."""
    panels = len(metrics) + scatter
    figure = new_figure(TEXT_WIDTH, 2.35 if panels > 2 else 2.65)
    axes = figure.subplots(1, panels, squeeze=False)[0]
    notes: list[str] = []
    for index, metric in enumerate(metrics):
        series, success = (curve_series(data, artefact, task, metric, shown) for shown in ("", "success"))
        notes += curve_panel(axes[index], index, metric, series, success)
        _mark_warm_up(axes[index], warm_up_steps(data, task))
    if scatter:
        panel_title(axes[-1], panels - 1, "Rewards' correlation")
        method = data.settings.single_target.method
        draw_scatter(axes[-1], correlation(data, task, SCATTER_CS_REWARD), method, SCATTER_CS_REWARD)
    add_legend(figure, axes[: len(metrics)], task)
    add_notes(figure, notes + scale_notes(data.settings.scale))
    return figure


def caption(data: FigureData, artefact: str, task: str, metrics: list[str], *, scatter: bool = False) -> str:
    """What the figure shows, with n, interval and transition set."""
    letters = ", ".join(f"({letter(index)}) {quantity(metric)}" for index, metric in enumerate(metrics))
    numbers = "; ".join(
        f"{quantity(metric)}: {counts(curve_series(data, artefact, task, metric))}" for metric in metrics
    )
    method = agent_label(data.settings.single_target.method)
    text = (
        f"{method}'s reward, learned from {task} with one target and tried on the same. {letters}: the agent during "
        "IRL (IRL agent), a new agent trained from scratch on r_task + the learned cs-reward (Transferred) and an "
        "agent without any cs-reward (SAC), training episodes of the stochastic policy. Red line: target. "
        f"Lines and bands: mean and 95 % t-interval over seeds ({numbers}); bands are cut off at the frame, "
        "curves end where the shortest run does. Success below the panels: of training episodes; tables have that of "
        "evaluation episodes."
    )
    warm_up = warm_up_steps(data, task)
    if warm_up:
        text += f" IRL starts after {warm_up:,} steps on r_task alone (dotted line)."
    if scatter:
        found = correlation(data, task, SCATTER_CS_REWARD)
        text += f" ({letter(len(metrics))}) {scatter_caption(found, SCATTER_CS_REWARD)}"
    return text


def warm_up_steps(data: FigureData, task: str) -> int:
    """Environment steps that a generator spends on the task reward alone before IRL."""
    irl = irl_run(data.settings, "single_target", [task]).irl
    return irl.warm_up_iterations * irl.steps_per_iteration


def _mark_warm_up(axes: Axes, steps: int) -> None:
    if 0 < steps < axes.get_xlim()[1]:
        axes.axvline(steps, color="0.45", linewidth=0.8, linestyle=":")
        axes.annotate(
            "IRL starts", (steps, 0.02), xycoords=("data", "axes fraction"), xytext=(2, 0),
            textcoords="offset points", fontsize=6, color="0.35",
        )  # fmt: skip
