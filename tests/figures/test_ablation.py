"""The figure of an ablation from made-up rows."""

import pandas as pd
import pytest

from mtcsirl.figures.ablation import STAGES, caption, draw, variant_rows
from mtcsirl.settings import Settings
from mtcsirl.study.ablations import ABLATIONS

SETTINGS = Settings()


def _rows(ablation: str) -> pd.DataFrame:
    chosen = SETTINGS.ablations
    frames = {
        variant: pd.DataFrame(
            [
                {
                    "stage": STAGES[agent], "task": task, "seed": seed, "metric": metric, "policy": policy,
                    "value": 0.1 * (number + seed), "status": "below gate" if variant == "default" else "ok",
                }
                for agent in ABLATIONS[ablation].agents for task in chosen.tasks for seed in chosen.seeds
                for metric in (chosen.cs_reward, "success", "task_reward") for policy in ("stochastic", "deterministic")
            ]
        )
        for number, variant in enumerate(ABLATIONS[ablation].variants)
    }  # fmt: skip
    return variant_rows(frames)


@pytest.mark.parametrize("ablation", ABLATIONS)
def test_every_variant_task_and_seed_has_its_mark(ablation: str) -> None:
    rows, agents, tasks = _rows(ablation), ABLATIONS[ablation].agents, SETTINGS.ablations.tasks
    figure = draw(ablation, rows, SETTINGS)
    assert len(figure.axes) == 3 * len(agents)
    for axes in figure.axes:
        marks = [line for line in axes.lines if line.get_marker() not in ("None", None, "")]
        assert len(marks) == len(ABLATIONS[ablation].variants) * len(tasks)
        assert all(len(line.get_xdata()) == len(SETTINGS.ablations.seeds) for line in marks)
    labels = [text.get_text() for text in figure.legends[0].get_texts()]
    assert labels == [variant.label for variant in ABLATIONS[ablation].variants.values()]


def test_the_caption_counts_seeds_and_agents_below_their_gate() -> None:
    text = caption("ablation_observation", _rows("ablation_observation"), SETTINGS)
    assert f"n = {len(SETTINGS.ablations.seeds)}" in text
    assert f"Below their gate: {2 * len(SETTINGS.ablations.seeds)} agents" in text


def test_nothing_yet_is_said_in_every_panel() -> None:
    empty = _rows("ablation_replay").assign(value=float("nan"))
    figure = draw("ablation_replay", empty, SETTINGS)
    assert all("no runs yet" in [text.get_text() for text in axes.texts] for axes in figure.axes)
