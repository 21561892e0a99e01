"""Figure 2: single task cs-reward on reach-wall; (a) action norm, (b) velocity, (c) correlation for velocity."""

from matplotlib.figure import Figure

from mtcsirl.figures import single_target
from mtcsirl.figures.data import FigureData
from mtcsirl.study.design import FIGURE_TASKS

TITLE = "Single task cs-reward: reach-wall"
_TASK = FIGURE_TASKS["figure_2"]


def draw(data: FigureData) -> Figure:
    """Learning curves of IRL agent, Transferred and SAC, and the scatter of true and learned reward."""
    return single_target.draw(data, "figure_2", _TASK, data.cs_rewards, scatter=True)


def caption(data: FigureData) -> str:
    """What the figure shows."""
    return single_target.caption(data, "figure_2", _TASK, data.cs_rewards, scatter=True)
