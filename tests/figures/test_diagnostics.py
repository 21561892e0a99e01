"""The figure of an IRL run from made-up rows with the names that real runs write."""

import math
from pathlib import Path

import pandas as pd
import pytest

from mtcsirl import cli
from mtcsirl.figures.diagnostics import CHANCE, caption, draw
from mtcsirl.figures.style import figure_bytes
from mtcsirl.files import storage
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


@pytest.fixture
def run(tmp_path: Path) -> Path:
    """The folder of an IRL run that can be drawn."""
    curve, diagnostics = _frames(("f",))
    storage.write_csv(tmp_path / "run" / "curve.csv", curve)
    storage.write_csv(tmp_path / "run" / "diagnostics.csv", diagnostics)
    storage.write_json(tmp_path / "run" / "reward.json", ABOUT)
    return tmp_path / "run"


def _draw(run: Path) -> int:
    return cli.main(["draw-diagnostics", "--run", str(run), "--output", str(run.parent / "drawn.png")])


def test_the_verb_draws_what_a_run_left(run: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert _draw(run) == 0
    assert capsys.readouterr().out.startswith("MT-CSIRL, velocity, seed 7. ")
    assert (run.parent / "drawn.png").is_file()


ABOUT = {"method": "mt_csirl", "cs_reward": "velocity", "about": {"seed": 7}}
LACKS = "lacks method, cs_reward or about.seed; name the folder of an IRL run"
FOREIGN = {
    "a list": ([], LACKS),
    "a text": ("reward", LACKS),
    "nothing about it": ({"method": "mt_csirl", "cs_reward": "velocity"}, LACKS),
    "null about it": (ABOUT | {"about": None}, LACKS),
    "no seed": (ABOUT | {"about": {}}, LACKS),
    "a text as seed": (ABOUT | {"about": {"seed": "x"}}, LACKS),
    "no method": ({"cs_reward": "velocity", "about": {"seed": 7}}, LACKS),
    "an unknown cs-reward": (ABOUT | {"cs_reward": "banana"}, "cs_reward 'banana' is none of velocity, action_norm"),
    "null as cs-reward": (ABOUT | {"cs_reward": None}, "cs_reward 'None' is none of"),
}


@pytest.mark.parametrize("what", FOREIGN)
def test_a_reward_that_says_nothing_of_its_run_is_one_line(
    run: Path, capsys: pytest.CaptureFixture[str], what: str
) -> None:
    content, says = FOREIGN[what]
    storage.write_json(run / "reward.json", content)
    assert _draw(run) == 2
    error = capsys.readouterr().err
    assert error.count("\n") == 1
    assert f"{run / 'reward.json'}: {says}" in error
    assert not list(run.parent.glob("drawn.*"))


@pytest.mark.parametrize("name", ["curve.csv", "diagnostics.csv"])
def test_a_run_that_logged_nothing_is_one_line(run: Path, capsys: pytest.CaptureFixture[str], name: str) -> None:
    storage.write_csv(run / name, storage.read_csv(run / name).iloc[:0])
    assert _draw(run) == 2
    assert f"{run / name}: holds no row" in capsys.readouterr().err
