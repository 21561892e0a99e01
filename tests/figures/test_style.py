"""Methods stay apart in colour, in greyscale and for the colour-blind."""

from itertools import combinations

import matplotlib
import numpy as np
import pytest
from matplotlib.colors import to_rgb

from mtcsirl.figures.style import (
    LOOKS,
    TARGET_COLOUR,
    caption_of,
    figure_bytes,
    look,
    new_figure,
    paper_style,
    quantity_label,
    styled,
)
from mtcsirl.names import METHODS

# Linear RGB as a person without red or without green receptors sees it (Machado et al. 2009, severity 1).
PROTAN = np.array([[0.152286, 1.052583, -0.204868], [0.114503, 0.786281, 0.099216], [-0.003882, -0.048116, 1.051998]])
DEUTAN = np.array([[0.367322, 0.860646, -0.227968], [0.280085, 0.672501, 0.047413], [-0.011820, 0.042940, 0.968881]])
TOGETHER = (("irl_agent", "mt_csirl", "sac"), ("expert", "mt_csirl", "sac"))


def test_every_method_of_the_study_has_its_own_look():
    assert {*METHODS, "expert", "sac"} <= set(LOOKS)
    for part in ("colour", "marker", "label", "linestyle"):
        assert len({getattr(one, part) for one in LOOKS.values()}) == len(LOOKS)


@pytest.mark.parametrize("matrix", [np.eye(3), PROTAN, DEUTAN], ids=["normal", "protan", "deutan"])
@pytest.mark.parametrize("methods", TOGETHER)
def test_methods_of_one_panel_differ_for_the_colour_blind(methods, matrix):
    seen = [matrix @ np.array(to_rgb(LOOKS[name].colour)) for name in methods]
    seen.append(matrix @ np.array(to_rgb(TARGET_COLOUR)))
    assert min(np.linalg.norm(a - b) for a, b in combinations(seen, 2)) > 0.25


def test_unknown_method_is_drawn_under_its_own_name():
    assert look("my_method").label == "MY-METHOD"
    assert look("my_method").colour not in {one.colour for one in LOOKS.values()}


@pytest.mark.parametrize("kind", ["png", "pdf"])
def test_equal_figures_give_equal_bytes(kind):
    def file() -> bytes:
        figure = new_figure(1, 1)
        figure.subplots().plot([0, 1], [1, 0])
        return figure_bytes(figure, kind)

    assert file() == file()


def test_file_carries_its_caption():
    caption = "Velocity: r = 0.18 [–0.1, 0.4], n = 5 seeds"
    assert caption_of(figure_bytes(new_figure(1, 1), "png", caption)) == caption
    assert caption_of(figure_bytes(new_figure(1, 1), "png")) == ""


def test_reader_settings_have_no_say():
    @styled
    def draw():
        return new_figure(1, 1), matplotlib.rcParams["font.size"]

    with matplotlib.rc_context({"font.size": 30}):
        assert draw()[1] == 7
        with paper_style():
            assert matplotlib.rcParams["axes.spines.top"] is False
        assert matplotlib.rcParams["font.size"] == 30


def test_units_on_axes():
    assert quantity_label("velocity") == "velocity (m/s)"
    assert quantity_label("action_norm") == r"action norm ($\Vert a\Vert_1$)", "no unit, so the formula"
    assert quantity_label("my_cs_reward") == "my cs reward"
