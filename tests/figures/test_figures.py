"""Every figure of results on made-up runs."""

import numpy as np
import pytest

from mtcsirl.errors import UserError
from mtcsirl.figures import FIGURES, figure_spec
from mtcsirl.figures.data import FigureData
from mtcsirl.figures.style import figure_bytes
from mtcsirl.results.notes import SMOKE_NOTE
from tests.figures.made_up import TARGETS

CURVES = ("figure_2", "figure_3", "figure_4", "figure_5", "figure_s1", "figure_s2")
RESULTS = (*CURVES, "figure_6", "figure_7")
PANELS = {"figure_2": 3, "figure_3": 3, "figure_6": 1, "figure_7": 1}


def texts(figure) -> str:
    own = [text.get_text() for text in figure.texts]
    if figure._supxlabel is not None:
        own.append(figure._supxlabel.get_text())
    for axes in figure.axes:
        own += [text.get_text() for text in axes.texts] + [axes.get_title("left"), axes.get_ylabel(), axes.get_xlabel()]
    return "\n".join(own)


@pytest.mark.parametrize("name", RESULTS)
def test_draws_all_panels_of_complete_results(name, data):
    figure = figure_spec(name).draw(data)
    assert len(figure.axes) == PANELS.get(name, 2)
    assert "not there yet" not in texts(figure)
    assert "no runs" not in texts(figure)
    assert SMOKE_NOTE not in texts(figure)


@pytest.mark.parametrize("name", CURVES)
def test_target_and_methods_of_the_paper(name, data):
    figure = figure_spec(name).draw(data)
    methods = ["Expert", "MT-CSIRL", "SAC"] if name == "figure_3" else ["IRL agent", "Transferred", "SAC"]
    shown = [text.get_text() for text in figure.legends[0].get_texts()]
    assert shown == [*methods, "target", "95 % t-interval"]
    order = ["action_norm", "velocity"] if name in ("figure_2", "figure_3") else ["velocity", "action_norm"]
    for axes, metric in zip(figure.axes, order, strict=False):
        assert metric.replace("_", " ") in axes.get_ylabel()
        lines = {line.get_label(): line for line in axes.lines if line.get_label() in methods}
        assert set(lines) == set(methods)
        heights = [lines[method].get_ydata()[-1] for method in methods]
        assert heights[2] < 0.7 * heights[1] < heights[0]
        assert any(np.allclose(line.get_ydata(), TARGETS[metric]) for line in axes.lines)


@pytest.mark.parametrize("name", RESULTS)
def test_caption_states_n_interval_and_set(name, data):
    caption = figure_spec(name).caption(data)
    assert "n = 3 seeds" in caption
    assert "95 %" in caption
    if name in PANELS:
        assert "plain SAC transitions" in caption
        assert "Pearson r = 0.9" in caption


@pytest.mark.parametrize("name", RESULTS)
def test_smoke_figures_say_that_they_mean_nothing(name, data):
    smoke = data.settings.model_copy(update={"scale": "smoke"})
    figure = figure_spec(name).draw(
        FigureData(settings=smoke, curves=data.curves, scores=data.scores, points=data.points)
    )
    assert SMOKE_NOTE in texts(figure)


@pytest.mark.parametrize("name", RESULTS)
def test_nothing_there_yet(name, settings):
    figure = figure_spec(name).draw(FigureData(settings=settings))
    assert "no runs yet" in texts(figure)
    assert figure_bytes(figure, "png").startswith(b"\x89PNG")
    assert figure_spec(name).caption(FigureData(settings=settings))


def test_missing_runs_are_named_and_the_rest_is_drawn(data):
    gone = (data.curves["stage"] == "transfer") & (data.curves["seed"] == 2)
    figure = figure_spec("figure_2").draw(
        FigureData(settings=data.settings, curves=data.curves[~gone], scores=data.scores, points=data.points)
    )
    assert "(a) not there yet – Transferred: reach-wall seed 2" in texts(figure)
    assert "(a) success in the last tenth of training: IRL agent" in texts(figure)
    assert any(line.get_label() == "Transferred" for line in figure.axes[0].lines)


def test_figure_3_names_the_tasks_of_an_incomplete_mean(data):
    gone = (data.curves["stage"] == "transfer") & (data.curves["task"] != "push-back")
    partial = FigureData(settings=data.settings, curves=data.curves[~gone], scores=data.scores, points=data.points)
    assert "(b) mean over the tasks that are there – MT-CSIRL: push-back" in texts(
        figure_spec("figure_3").draw(partial)
    )
    assert "mean over the tasks" not in texts(figure_spec("figure_3").draw(data))
    assert "the unseen test task" in figure_spec("figure_3").caption(data), "the paper's shows one task"


def test_task_of_each_figure_is_the_papers(data):
    named = {name: figure_spec(name).caption(data) for name in CURVES if name != "figure_3"}
    tasks = ("reach-wall", "button-press-topdown-wall", "coffee-button", "drawer-close", "push-back")
    assert all(task in caption for task, caption in zip(tasks, named.values(), strict=True))


def test_architecture_shows_the_papers_parts(data):
    figure = figure_spec("figure_1").draw(data)
    shown = texts(figure)
    for part in (
        "expert",
        "demonstrations",
        "discriminator",
        "generator",
        r"f_\theta",
        r"\alpha(\bar{r}_{T})",
        "$\\tau_{1}$",
    ):
        assert part in shown
    frame = figure.bbox
    for text in figure.axes[0].texts:
        box = text.get_window_extent()
        assert frame.x0 <= box.x0
        assert box.x1 <= frame.x1
        assert frame.y0 <= box.y0
        assert box.y1 <= frame.y1


def test_unknown_figure_is_a_user_error():
    with pytest.raises(UserError, match=r"unknown figure 'figure_10'; allowed: figure_1, .*figure_s2"):
        figure_spec("figure_10")


def test_every_figure_is_complete():
    for name in FIGURES:
        spec = figure_spec(name)
        assert spec.title
        assert callable(spec.draw)
        assert callable(spec.caption)
    assert [name for name in FIGURES if figure_spec(name).rendered] == ["figure_8", "figure_9"]
