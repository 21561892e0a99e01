"""What one IRL run logged, iteration by iteration: generators in the first two rows, each discriminator in one more."""

import math
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from mtcsirl.figures.style import (
    COLOURS,
    TARGET_COLOUR,
    add_notes,
    empty_panel,
    new_figure,
    panel_title,
    quantity_label,
    scale_notes,
    step_axis,
    styled,
    target_of,
)

LineStyle = str | tuple[int, tuple[int, ...]]
EXPERT: LineStyle = (0, (3, 1))
GENERATOR: LineStyle = "-"
COLUMNS = 4
WIDTH, PANEL_HEIGHT, LINE_HEIGHT = 7.5, 1.45, 0.15
"""Inches; the last of one line of the legend."""
WINDOW = 5
"""Iterations of the centred running mean: single rollouts and minibatches hide the trend."""


class Panel(NamedTuple):
    """One panel: its title, its metrics with their line styles, and the label of its value axis."""

    title: str
    lines: Mapping[str, LineStyle]
    label: str


GENERATOR_PANELS = (
    Panel("success", {"success": "-"}, "share of episodes"),
    Panel("task reward", {"task_reward": "-"}, "per step"),
    Panel("curriculum", {"curriculum": "-"}, r"$\alpha$"),
    Panel("log π", {"log_pi_expert_q50": EXPERT, "log_pi_generator_q50": GENERATOR}, "nats"),
    Panel("temperature", {"temperature": "-"}, "reward units"),
    Panel("critics", {"critic_gradient_norm": "-"}, "gradient norm"),
    Panel("actor", {"actor_gradient_norm": "-"}, "gradient norm"),
)
DISCRIMINATOR_PANELS = (
    Panel("accuracy", {"accuracy_expert": EXPERT, "accuracy_generator": GENERATOR}, "share right"),
    Panel("loss", {"cross_entropy": "-"}, "cross-entropy (nats)"),
    Panel("reward", {"f_expert_mean": EXPERT, "f_generator_mean": GENERATOR}, "mean"),
    Panel("step", {"gradient_norm": "-"}, "gradient norm"),
)
BOTTLENECK_PANELS = (
    Panel("bottleneck", {"kl": "-"}, "KL (nats)"),
    Panel("multiplier", {"beta": "-"}, r"$\beta$"),
    Panel("logit", {"logit_expert": EXPERT, "logit_generator": GENERATOR}, "mean"),
    Panel("truth", {"pearson_generator": "-"}, "Pearson's r"),
)
"""One more row for MT-VAIRL(-GP)."""
ENDS = ("q05", "q95")
CHANCE = {"accuracy": 0.5, "loss": 1.3863}
"""Where a discriminator that tells nothing apart is: half right, 2 log 2."""


@styled
def draw(curve: pd.DataFrame, diagnostics: pd.DataFrame, cs_reward: str, title: str, scale: str) -> Figure:
    """Panels over environment steps per generator; one colour per task and target, the ninth begins anew.

    ``curve`` and ``diagnostics`` as an IRL run writes them.
    """
    members = list(dict.fromkeys(zip(curve["task"], curve["target"], strict=True)))
    names = [name for name in diagnostics["discriminator"].unique() if name]
    behaviour = Panel("behaviour", {cs_reward: "-"}, quantity_label(cs_reward))
    of_discriminator = DISCRIMINATOR_PANELS + (BOTTLENECK_PANELS if (diagnostics["metric"] == "kl").any() else ())
    panels = [(panel, "") for panel in (behaviour, *GENERATOR_PANELS)]
    panels += [(panel, name) for name in names for panel in of_discriminator]
    rows, legend_columns = len(panels) // COLUMNS, 3
    figure = new_figure(WIDTH, 0.4 + PANEL_HEIGHT * rows + LINE_HEIGHT * math.ceil(len(members) / legend_columns))
    figure.suptitle(title)
    grid = figure.subplots(rows, COLUMNS, sharex=True)
    both = pd.concat([curve.assign(discriminator=""), _only_in(diagnostics, curve)], ignore_index=True)
    for index, (axes, (panel, name)) in enumerate(zip(grid.flat, panels, strict=True)):
        own = both[both["discriminator"] == name]
        _draw_panel(axes, panel, own, members)
        panel_title(axes, index, f"{name}: {panel.title}" if name else panel.title)
        if panel is behaviour:
            axes.axhline(target_of(cs_reward), color=TARGET_COLOUR, linewidth=0.8)
    for axes in grid[-1]:
        step_axis(axes)
    handles, labels = grid[0, 0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=min(legend_columns, len(labels)))
    add_notes(figure, scale_notes(scale))
    return figure


def _only_in(diagnostics: pd.DataFrame, curve: pd.DataFrame) -> pd.DataFrame:
    """Diagnostics without what the curve has too."""
    return diagnostics[~diagnostics["metric"].isin(curve["metric"].unique())]


def _draw_panel(axes: Axes, panel: Panel, rows: pd.DataFrame, members: Sequence[tuple[str, int]]) -> None:
    axes.set_ylabel(panel.label)
    if rows.loc[rows["metric"].isin(list(panel.lines)), "value"].notna().sum() == 0:
        empty_panel(axes, "not logged by this method")
        return
    for number, (task, target) in enumerate(members):
        of_member = rows[(rows["task"] == task) & (rows["target"] == target)]
        for metric, style in panel.lines.items():
            own = of_member[of_member["metric"] == metric].sort_values("step")
            smooth = own["value"].rolling(WINDOW, center=True, min_periods=1).mean()
            name = f"{task}, target {target}" if style == GENERATOR else None
            axes.plot(
                own["step"], smooth, color=COLOURS[number % len(COLOURS)], linestyle=style, label=name, linewidth=1
            )
        if panel.title == "log π":
            _draw_range(axes, of_member, COLOURS[number % len(COLOURS)])
    if panel.title in CHANCE:
        axes.axhline(CHANCE[panel.title], color="0.5", linewidth=0.8, linestyle=":")
    if panel.title in ("accuracy", "success"):
        axes.set_ylim(-0.03, 1.03)


def _draw_range(axes: Axes, rows: pd.DataFrame, colour: str) -> None:
    """The middle 90 % of log pi on the generator's transitions as a faint band."""
    wide = rows.pivot_table(index="step", columns="metric", values="value")
    low, high = (wide[f"log_pi_generator_{end}"].rolling(WINDOW, center=True, min_periods=1).mean() for end in ENDS)
    axes.fill_between(wide.index, low, high, color=colour, alpha=0.08, linewidth=0)


def caption(title: str) -> str:
    """What the figure shows."""
    return (
        f"{title}. Running means over {WINDOW} iterations, one colour per task and target; dashed: the experts', "
        "solid: the generator's transitions; dotted: a discriminator that tells nothing apart; red: the target. "
        "log π: medians; band: the middle 90 % of the generator's. Temperature in units of the reward."
    )
