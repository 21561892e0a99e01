"""Figure S1: single task cs-reward on drawer-close; (a) velocity, (b) action norm.

The paper's text names this task, none of its figures shows it.
"""

from matplotlib.figure import Figure

from mtcsirl.figures import single_target
from mtcsirl.figures.data import FigureData
from mtcsirl.study.design import FIGURE_TASKS

TITLE = "Single task cs-reward: drawer-close"
_TASK = FIGURE_TASKS["figure_s1"]


def draw(data: FigureData) -> Figure:
    """Learning curves of IRL agent, Transferred and SAC."""
    return single_target.draw(data, "figure_s1", _TASK, data.cs_rewards[::-1])


def caption(data: FigureData) -> str:
    """What the figure shows."""
    return single_target.caption(data, "figure_s1", _TASK, data.cs_rewards[::-1])
