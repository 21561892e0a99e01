"""The figure of an IRL run from made-up rows with the names that real runs write."""

import math

import pandas as pd
import pytest

from mtcsirl.figures.diagnostics import CHANCE, caption, draw
from mtcsirl.figures.style import figure_bytes
from mtcsirl.names import DIAGNOSTIC_COLUMNS
from mtcsirl.results.notes import SMOKE_NOTE

MEMBERS = (("reach", 1), ("drawer-close", 2))
OF_GENERATOR = [
    *(f"log_pi_{side}_q{q}" for side in ("expert", "generator") for q in ("05", "50", "95")),
    "temperature", "curriculum", "critic_gradient_norm", "actor_gradient_norm",
]  # fmt: skip
OF_DISCRIMINATOR = [
    "accuracy_expert", "accuracy_generator", "cross_entropy", "f_expert_mean", "f_generator_mean", "gradient_norm",
]  # fmt: skip


def _frames(discriminators: tuple[str, ...]) -> tuple[pd.DataFrame, pd.DataFrame]:
    steps = range(500, 10_001, 500)
    curve, diagnostics = [], []
    for (task, target), step in ((member, step) for member in MEMBERS for step in steps):
        key = {"task": task, "target": target, "step": step, "value": 0.5}
        curve += [
            key | {"metric": name} for name in ("velocity", "success", "task_reward", "temperature", "curriculum")
        ]
        diagnostics += [key | {"metric": name, "discriminator": ""} for name in OF_GENERATOR]
        diagnostics += [
            key | {"metric": name, "discriminator": one} for name in OF_DISCRIMINATOR for one in discriminators
        ]
    return pd.DataFrame(curve), pd.DataFrame(diagnostics)[list(DIAGNOSTIC_COLUMNS)]


@pytest.mark.parametrize("discriminators", [("f",), ("task", "f")])
def test_every_panel_has_every_generator(discriminators: tuple[str, ...]) -> None:
    figure = draw(*_frames(discriminators), "velocity", "MT-CSIRL+LT", "desk")
    assert len(figure.axes) == 4 * (2 + len(discriminators))
    for axes in figure.axes:
        drawn = {line.get_color() for line in axes.lines if len(line.get_xdata()) > 2}
        assert len(drawn) == len(MEMBERS), axes.get_title(loc="left")
    labels = [text.get_text() for text in figure.legends[0].get_texts()]
    assert labels == ["reach, target 1", "drawer-close, target 2"]


def test_a_bottleneck_has_a_row_of_its_own() -> None:
    curve, diagnostics = _frames(("f",))
    losses = diagnostics[diagnostics["metric"] == "cross_entropy"]
    rows = pd.concat([diagnostics, losses.assign(metric="kl"), losses.assign(metric="beta", value=0.1)])
    figure = draw(curve, rows, "velocity", "MT-VAIRL", "desk")
    titles = [axes.get_title(loc="left") for axes in figure.axes]
    assert len(titles) == 16
    assert titles[12:14] == ["(m) f: bottleneck", "(n) f: multiplier"]
    assert {tuple(line.get_ydata()) for line in figure.axes[13].lines} == {(0.1,) * 20}


def test_values_of_the_curve_and_of_the_diagnostics_are_not_mixed() -> None:
    """Both files hold the temperature; were both drawn, each line would have two points per step."""
    figure = draw(*_frames(("f",)), "velocity", "MT-CSIRL", "desk")
    for axes in figure.axes:
        for line in axes.lines:
            assert len(set(line.get_xdata())) == len(line.get_xdata())


def test_what_a_method_does_not_log_is_said() -> None:
    curve, diagnostics = _frames(("f",))
    figure = draw(curve[curve["metric"] != "curriculum"], diagnostics[diagnostics["metric"] != "curriculum"],
                  "velocity", "MT-AIRL", "smoke")  # fmt: skip
    said = [text.get_text() for axes in figure.axes for text in axes.texts]
    assert said == ["not logged by this method"]
    assert figure.get_supxlabel() == SMOKE_NOTE
    assert figure_bytes(figure, "png", caption("MT-AIRL")).startswith(b"\x89PNG")


def test_chance_is_half_right_and_two_log_two() -> None:
    assert CHANCE["accuracy"] == 0.5
    assert math.isclose(CHANCE["loss"], 2 * math.log(2), abs_tol=1e-4)
