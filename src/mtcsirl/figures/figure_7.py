"""Figure 7: action norm, true against learned cs-reward, learned from several tasks with MT-CSIRL."""

from matplotlib.figure import Figure

from mtcsirl.figures import multi_task
from mtcsirl.figures.data import FigureData
from mtcsirl.figures.scatter import scatter_caption, scatter_figure

TITLE = "Action norm: true and learned reward, several tasks"
_CS_REWARD = "action_norm"


def draw(data: FigureData) -> Figure:
    """The scatter with its correlation."""
    return scatter_figure(data.settings.scale, multi_task.correlation(data, _CS_REWARD), multi_task.METHOD, _CS_REWARD)


def caption(data: FigureData) -> str:
    """What the figure shows."""
    found = multi_task.correlation(data, _CS_REWARD)
    task = data.settings.multi_task.unseen_tasks[0]
    return f"MT-CSIRL reward on the unseen task {task}. {scatter_caption(found, _CS_REWARD)}"
