"""Controls behave as theory says; a short run of MT-CSIRL moves the right way."""

import numpy as np
import pandas as pd
import pytest

from mtcsirl.validation.figure import caption, draw
from mtcsirl.validation.recovery import Findings, recover
from mtcsirl.validation.recovery import shrunk as shrunk_settings


@pytest.fixture(scope="module")
def findings() -> Findings:
    return recover(shrunk_settings())


def _agents(findings: Findings, metric: str) -> pd.Series:
    rows = findings.agents[findings.agents["metric"] == metric]
    return rows.set_index("reward")["value"]


@pytest.mark.slow
def test_the_true_reward_gives_the_expert_and_no_reward_gives_plain_sac(findings) -> None:
    speed, spread = _agents(findings, "speed"), _agents(findings, "speed_std")
    assert speed["truth"] == pytest.approx(speed["expert"], abs=0.06)
    assert spread["truth"] == pytest.approx(spread["expert"], abs=0.06)
    assert speed["zero"] < speed["truth"] - 0.1
    assert spread["zero"] > 1.3 * spread["truth"]


@pytest.mark.slow
def test_minus_the_task_reward_leaves_nothing_to_learn(findings) -> None:
    assert _agents(findings, "speed")["minus task"] == pytest.approx(0.5, abs=0.08)
    reward = _agents(findings, "task_reward")
    assert reward["minus task"] < reward["zero"] < 0


@pytest.mark.slow
def test_controls_correlate_as_they_must(findings) -> None:
    rows = findings.correlations
    residual = rows[(rows["statistic"] == "pearson_residual") & (rows["transitions"] == "uniform")]
    residual = residual.set_index("reward")["value"]
    assert residual["truth"] == pytest.approx(1.0)
    assert np.isnan(residual["zero"])
    assert abs(residual["minus task"]) < 0.2
    assert residual["four goals"] >= 0.9, "a shared f is the cs-reward up to a potential"


@pytest.mark.slow
def test_the_new_agent_with_the_learned_reward_moves_as_the_expert(findings) -> None:
    speed, spread = _agents(findings, "speed"), _agents(findings, "speed_std")
    assert speed["four goals"] == pytest.approx(speed["expert"], abs=0.1)
    assert spread["four goals"] < 0.8 * spread["zero"]


@pytest.mark.slow
def test_the_figure_and_its_caption_show_every_reward(findings) -> None:
    figure = draw(findings)
    labels = [label.get_text() for label in figure.axes[0].get_yticklabels()]
    assert set(labels) == {"f = truth", "four goals", "one goal", "f = random", "f = zero", "f = minus task"}
    assert "seeds: 1" in caption(findings)
