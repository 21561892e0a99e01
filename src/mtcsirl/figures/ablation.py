"""An ablation as a figure: what each variant's agents reach, task by task."""

from collections.abc import Mapping

import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from mtcsirl.figures.style import (
    COLOURS,
    NO_RUNS,
    TARGET_COLOUR,
    TEXT_WIDTH,
    add_notes,
    empty_panel,
    new_figure,
    panel_title,
    quantity_label,
    scale_notes,
    styled,
    target_of,
)
from mtcsirl.settings import Settings
from mtcsirl.study.ablations import ABLATIONS

LOOKS = tuple(zip(COLOURS, "oDs^", strict=False))
"""Colour and marker of the variants in their order."""
STAGES = {"expert": "train_expert", "irl": "learn_reward", "transfer": "transfer"}
NAMES = {"expert": "experts", "irl": "generators", "transfer": "new agents"}


def variant_rows(frames: Mapping[str, pd.DataFrame]) -> pd.DataFrame:
    """The evaluation rows of all variants with the column ``variant``; stochastic policies."""
    rows = pd.concat([frame.assign(variant=name) for name, frame in frames.items()], ignore_index=True)
    return rows[rows["policy"] == "stochastic"].drop(columns="policy")


@styled
def draw(ablation: str, rows: pd.DataFrame, settings: Settings) -> Figure:
    """One row of panels per kind of agent, one column per metric; one mark per seed, a line at the mean."""
    agents = ABLATIONS[ablation].agents
    metrics = (settings.ablations.cs_reward, "success", "task_reward")
    figure = new_figure(TEXT_WIDTH, 0.5 + 1.8 * len(agents))
    panels = figure.subplots(len(agents), len(metrics), squeeze=False)
    for index, axes in enumerate(panels.flat):
        agent, metric = agents[index // len(metrics)], metrics[index % len(metrics)]
        own = rows[(rows["stage"] == STAGES[agent]) & (rows["metric"] == metric)]
        _draw_panel(axes, ablation, own, settings)
        axes.set_ylabel(quantity_label(metric))
        if metric == "success":
            axes.set_ylim(-0.05, 1.05)
        panel_title(axes, index, NAMES[agent])
        if metric == settings.ablations.cs_reward:
            axes.axhline(target_of(metric), color=TARGET_COLOUR, linewidth=0.8, linestyle=":")
    handles, labels = panels[0, 0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper center", ncols=min(3, len(labels) or 1))
    add_notes(figure, scale_notes(settings.scale))
    return figure


def _draw_panel(axes: Axes, ablation: str, rows: pd.DataFrame, settings: Settings) -> None:
    variants, tasks = ABLATIONS[ablation].variants, settings.ablations.tasks
    if rows["value"].notna().sum() == 0:
        empty_panel(axes, NO_RUNS)
    for number, (name, variant) in enumerate(variants.items()):
        colour, marker = LOOKS[number % len(LOOKS)]
        offset = (number - (len(variants) - 1) / 2) * 0.8 / len(variants)
        for place, task in enumerate(tasks):
            values = rows.loc[(rows["variant"] == name) & (rows["task"] == task), "value"].dropna()
            label = variant.label if place == 0 else None
            axes.plot(
                [place + offset] * len(values), values, marker, color=colour, markersize=4, linestyle="", label=label
            )
            if len(values):
                axes.hlines(values.mean(), place + offset - 0.1, place + offset + 0.1, color=colour, linewidth=1.2)
    axes.set_xticks(range(len(tasks)), tasks, fontsize=6.5)
    axes.set_xlim(-0.5, len(tasks) - 0.5)


def caption(ablation: str, rows: pd.DataFrame, settings: Settings) -> str:
    """What the figure shows."""
    kinds = " and ".join(NAMES[agent] for agent in ABLATIONS[ablation].agents)
    seeds = rows.loc[rows["value"].notna(), "seed"].nunique()
    below = rows.loc[rows["status"] == "below gate", ["variant", "stage", "task", "seed"]].drop_duplicates()
    return (
        f"{ABLATIONS[ablation].question} Means over the evaluation episodes of {kinds} on "
        f"{', '.join(settings.ablations.tasks)}, cs-reward {settings.ablations.cs_reward}, stochastic policy; one mark "
        f"per seed (n = {seeds}), a line at their mean; dotted: the target. Below their gate: {len(below)} agents."
    )
