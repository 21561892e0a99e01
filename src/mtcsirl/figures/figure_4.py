"""Figure 4: single task cs-reward on button-press-topdown-wall; (a) velocity, (b) action norm."""

from matplotlib.figure import Figure

from mtcsirl.figures import single_target
from mtcsirl.figures.data import FigureData
from mtcsirl.study.design import FIGURE_TASKS

TITLE = "Single task cs-reward: button-press-topdown-wall"
_TASK = FIGURE_TASKS["figure_4"]


def draw(data: FigureData) -> Figure:
    """Learning curves of IRL agent, Transferred and SAC."""
    return single_target.draw(data, "figure_4", _TASK, data.cs_rewards[::-1])


def caption(data: FigureData) -> str:
    """What the figure shows."""
    return single_target.caption(data, "figure_4", _TASK, data.cs_rewards[::-1])
