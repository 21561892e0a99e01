"""Figure 1: MT-CSIRL architecture overview, drawn from the text of section 4 (Algorithm 1, equations 5 to 7)."""

from typing import Any

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import FancyArrowPatch, FancyBboxPatch

from mtcsirl.figures.data import FigureData
from mtcsirl.figures.style import INK, LOOKS, NOTE_COLOUR, TEXT_WIDTH, new_figure, scale_notes, styled

TITLE = "MT-CSIRL architecture overview"
_EXPERT, _SHARED, _POLICY, _TASK = LOOKS["expert"].colour, LOOKS["mt_csirl"].colour, "#D55E00", "#666666"
_COLUMNS = ((0.17, "1"), (0.44, "2"), (0.80, "T"))
_WIDTH = 0.235
_ROWS = {"demonstrations": 0.88, "discriminator": 0.68, "shared": 0.475, "reward": 0.285, "generator": 0.09}


@styled
def draw(data: FigureData) -> Figure:
    """One column per task; the shared cs-reward f is a bar across all of them."""
    figure = new_figure(TEXT_WIDTH, 4.1)
    figure.set_layout_engine("none")
    axes = figure.add_axes((0, 0, 1, 1))
    axes.set_axis_off()
    axes.set_xlim(0, 1)
    axes.set_ylim(-0.11, 0.96)
    for x, task in _COLUMNS:
        _draw_task(axes, x, task)
    _box(axes, 0.485, _ROWS["shared"], 0.87, 0.105, _SHARED, fill=True)
    axes.text(
        0.485,
        _ROWS["shared"],
        r"shared common-sense reward  $f_\theta(s, a, s^\prime)$" + "\none network for all tasks",
        ha="center",
        va="center",
        color="white",
        fontsize=8,
        linespacing=1.4,
        zorder=5,
    )
    for row in ("demonstrations", "discriminator", "reward", "generator"):
        axes.text(0.62, _ROWS[row], r"$\cdots$", ha="center", va="center", fontsize=12, color=INK)
    _legend(axes)
    notes = scale_notes(data.settings.scale)
    if notes:
        axes.set_ylim(-0.15, 0.96)
        axes.text(0.5, -0.13, notes[0], ha="center", fontsize=6.5, color=NOTE_COLOUR)
    return figure


def caption(data: FigureData) -> str:
    """What the figure shows."""
    return (
        "Each of T tasks has demonstrations of its expert, its own policy (generator) "
        "and its known task reward; the task discriminators share one network f, the common-sense reward. D_updates "
        "times per iteration each discriminator learns to tell expert from generator transitions, which updates f; "
        "G_updates times the policy is updated with the task reward plus alpha f, where alpha is the curriculum "
        "weight, the mean task reward of the last 256 steps over R_MAX. A new agent is trained on the task reward "
        "of its task plus the frozen f."
    )


def _draw_task(axes: Axes, x: float, t: str) -> None:
    """The column of task ``t``: demonstrations, discriminator, policy reward, generator."""
    _text_box(axes, x, "demonstrations", _EXPERT, f"expert $\\pi^*_{{{t}}}$\ndemonstrations $\\mathcal{{D}}_{{{t}}}$")
    _box(axes, x, _ROWS["discriminator"], _WIDTH, 0.16, INK)
    logit = rf"\exp(f_\theta + \bar{{r}}_{{{t}}})"
    _text(axes, x, _ROWS["discriminator"] + 0.05, f"discriminator $D^{{{t}}}_\\theta$")
    _text(axes, x, _ROWS["discriminator"] - 0.02, rf"$\dfrac{{{logit}}}{{{logit} + \pi_{{w_{{{t}}}}}}}$")
    _text_box(
        axes, x, "reward", _TASK, f"policy reward\n$\\bar{{r}}_{{{t}}} + \\alpha(\\bar{{r}}_{{{t}}})\\, f_\\theta$"
    )
    _text_box(axes, x, "generator", _POLICY, f"generator $\\pi_{{w_{{{t}}}}}$ (SAC)\nin task {t}")
    _arrow(axes, (x, 0.832), (x, 0.764), _EXPERT)
    _arrow(axes, (x - 0.03, 0.531), (x - 0.03, 0.597), _SHARED)
    _arrow(axes, (x + 0.03, 0.597), (x + 0.03, 0.531), _SHARED, dashed=True)
    _arrow(axes, (x, 0.42), (x, 0.335), _SHARED)
    _arrow(axes, (x, 0.237), (x, 0.142), _TASK)
    side = x + _WIDTH / 2
    axes.plot([side, side + 0.022, side + 0.022], [0.09, 0.09, 0.68], color=_POLICY, linewidth=1, zorder=3)
    _arrow(axes, (side + 0.022, 0.68), (side, 0.68), _POLICY)
    axes.text(side + 0.012, 0.375, f"$\\tau_{{{t}}}$", color=_POLICY, ha="right", va="center", fontsize=8)


def _text_box(axes: Axes, x: float, row: str, colour: str, text: str) -> None:
    _box(axes, x, _ROWS[row], _WIDTH, 0.095, colour)
    _text(axes, x, _ROWS[row], text)


def _text(axes: Axes, x: float, y: float, text: str) -> None:
    axes.text(x, y, text, ha="center", va="center", color=INK, fontsize=7.5, linespacing=1.35, zorder=5)


def _box(axes: Axes, x: float, y: float, width: float, height: float, colour: str, *, fill: bool = False) -> None:
    axes.add_patch(
        FancyBboxPatch(
            (x - width / 2, y - height / 2),
            width,
            height,
            boxstyle="round,pad=0,rounding_size=0.015",
            facecolor=colour if fill else "white",
            edgecolor=colour,
            linewidth=1.2,
            zorder=4,
        )
    )


def _arrow(
    axes: Axes, start: tuple[float, float], end: tuple[float, float], colour: str, *, dashed: bool = False
) -> None:
    style: dict[str, Any] = {"linestyle": (0, (3, 1.5))} if dashed else {}
    axes.add_patch(
        FancyArrowPatch(
            start, end, arrowstyle="-|>", mutation_scale=8, color=colour, linewidth=1, shrinkA=0, shrinkB=0, **style
        )
    )


def _legend(axes: Axes) -> None:
    """What the arrows mean."""
    entries: tuple[tuple[float, float, str, bool, str], ...] = (
        (0.05, 0, _SHARED, False, r"value of $f_\theta$"),
        (0.05, 1, _SHARED, True, r"gradient of $\mathcal{L}(\theta)$ updates $f_\theta$"),
        (0.36, 0, _EXPERT, False, "expert transitions"),
        (0.36, 1, _POLICY, False, r"generator trajectories $\tau_t$"),
        (0.66, 0, _TASK, False, r"reward of the SAC update of $w_t$"),
    )
    for x, line, colour, dashed, text in entries:
        y = -0.02 - 0.05 * line
        _arrow(axes, (x, y), (x + 0.045, y), colour, dashed=dashed)
        axes.text(x + 0.055, y, text, va="center", fontsize=6.5, color=INK)
    axes.text(
        0.66, -0.07, r"$\bar{r}_t$: known task reward, $\alpha$: curriculum", va="center", fontsize=6.5, color=INK
    )
