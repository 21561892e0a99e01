"""Figure S2: single task cs-reward on push-back; (a) velocity, (b) action norm. Not in the paper."""

from matplotlib.figure import Figure

from mtcsirl.figures import single_target
from mtcsirl.figures.data import FigureData
from mtcsirl.study.design import FIGURE_TASKS

TITLE = "Single task cs-reward: push-back"
_TASK = FIGURE_TASKS["figure_s2"]


def draw(data: FigureData) -> Figure:
    """Learning curves of IRL agent, Transferred and SAC."""
    return single_target.draw(data, "figure_s2", _TASK, data.cs_rewards[::-1])


def caption(data: FigureData) -> str:
    """What the figure shows."""
    return single_target.caption(data, "figure_s2", _TASK, data.cs_rewards[::-1])
