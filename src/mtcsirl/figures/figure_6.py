"""Figure 6: action norm, true against learned cs-reward, learned from a single task."""

from matplotlib.figure import Figure

from mtcsirl.figures import single_target
from mtcsirl.figures.data import FigureData
from mtcsirl.figures.scatter import scatter_caption, scatter_figure
from mtcsirl.names import agent_label

TITLE = "Action norm: true and learned reward, single task"
_CS_REWARD = "action_norm"


def draw(data: FigureData) -> Figure:
    """The scatter with its correlation."""
    return scatter_figure(
        data.settings.scale,
        single_target.correlation(data, data.settings.single_target.tasks[0], _CS_REWARD),
        data.settings.single_target.method,
        _CS_REWARD,
    )


def caption(data: FigureData) -> str:
    """What the figure shows."""
    task = data.settings.single_target.tasks[0]
    found = single_target.correlation(data, task, _CS_REWARD)
    method = agent_label(data.settings.single_target.method)
    return f"{method}'s reward, learned from a single task and target, {task}. {scatter_caption(found, _CS_REWARD)}"
