"""Learning curves against numbers worked out by hand."""

import numpy as np
import pandas as pd
import pytest

from mtcsirl.figures.curves import (
    Series,
    add_legend,
    budgets,
    counts,
    curve_panel,
    curve_title,
    draw_curves,
    missing_note,
    own_shares,
    success_note,
    summarise_curve,
    tasks_note,
)
from mtcsirl.figures.style import LOOKS, new_figure


def rows(values: dict[tuple[str, int], list[float]], steps=(500, 1000)) -> pd.DataFrame:
    return pd.DataFrame(
        [
            {"task": task, "seed": seed, "step": step, "value": value}
            for (task, seed), line in values.items()
            for step, value in zip(steps, line, strict=False)
        ]
    )


def series(values, expected, steps=(500, 1000)) -> Series:
    frame = rows(values, steps) if values else pd.DataFrame(columns=["task", "seed", "step", "value"])
    return Series("SAC", LOOKS["sac"], frame, tuple(expected))


def test_mean_and_t_interval_over_seeds():
    curve = summarise_curve(rows({("a", 0): [1.0, 2.0], ("a", 1): [3.0, 2.0], ("a", 2): [2.0, 2.0]}))
    half = 4.302652729911275 * 1.0 / np.sqrt(3)  # t(0.975, 2) times the standard error of 1, 3, 2
    assert curve["mean"].tolist() == [2.0, 2.0]
    assert curve.loc[0, ["low", "high"]].tolist() == pytest.approx([2 - half, 2 + half])
    assert curve.loc[1, ["low", "high"]].tolist() == pytest.approx([2.0, 2.0])
    assert curve["n"].tolist() == [3, 3]
    assert curve["step"].tolist() == [500, 1000]


def test_each_task_counts_once_however_many_rows_it_has():
    frame = pd.concat([rows({("a", 0): [1.0] * 2}), *[rows({("b", 0): [4.0] * 2})] * 3])
    assert summarise_curve(frame)["mean"].tolist() == [2.5, 2.5]


def test_curves_end_with_the_shortest_run():
    frame = rows({("a", 0): [1.0, 1.0, 1.0, 1.0], ("a", 1): [3.0, 3.0]}, steps=(500, 1000, 1500, 2000))
    curve = summarise_curve(frame)
    assert curve["step"].max() == 1000
    assert curve["mean"].tolist() == [2.0, 2.0]


def test_tasks_of_other_budgets_are_drawn_by_their_own_shares():
    """A slow learner of 100 steps that begins late counts to its end beside one of 50."""
    slow, quick = [0.0] * 50 + [1.0] * 50, [1.0] * 50
    uneven = series({("a", 0): slow, ("b", 0): quick}, [], steps=range(1, 101))
    assert budgets([uneven, series({}, [])]) == (50, 100)
    shares = summarise_curve(own_shares(uneven).rows)
    assert shares["step"].iloc[-1] == pytest.approx(100, abs=2)
    assert shares["mean"].iloc[-1] == 1.0, "both at their end"
    assert summarise_curve(uneven.rows)["mean"].max() == 0.5, "by steps the slow one is cut off half trained"
    axes = new_figure(2, 2).subplots()
    curve_panel(axes, 0, "velocity", [uneven], [])
    assert axes.get_xlabel() == "% of an agent's 0.05k to 0.1k steps"


def test_one_budget_for_all_tasks_of_a_method_keeps_steps():
    axes = new_figure(2, 2).subplots()
    short, long = series({("a", 0): [1.0, 1.0]}, []), series({("a", 0): [1.0] * 3}, [], steps=(500, 1000, 1500))
    curve_panel(axes, 0, "velocity", [short, long], [])
    assert axes.get_xlabel() == "environment steps"
    assert max(axes.lines[1].get_xdata()) == 1500


def test_few_rows_of_unlike_steps_leave_every_bin_a_mean_over_all_runs():
    both = pd.concat([rows({("a", 0): [1.0, 1.0]}, (50, 100)), rows({("a", 1): [3.0] * 3}, (33, 67, 100))])
    assert summarise_curve(both)[["mean", "n"]].to_numpy().tolist() == [[2.0, 2.0], [2.0, 2.0]]


@pytest.mark.parametrize(("seeds", "band"), [(2, ["95 % t-interval"]), (1, [])])
def test_the_legend_names_target_tasks_and_what_a_band_is(seeds, band):
    figure = new_figure(3, 2)
    axes = figure.subplots()
    shown = series({("a", seed): [0.1, 0.1 + seed] for seed in range(seeds)}, [])
    draw_curves(axes, [shown], "velocity", 0.8)
    add_legend(figure, [axes], "drawer-close")
    legend = figure.legends[0]
    assert [text.get_text() for text in legend.get_texts()] == ["SAC", "target", *band]
    assert legend.get_title().get_text() == "drawer-close"


def test_one_seed_has_no_interval():
    assert summarise_curve(rows({("a", 0): [1.0, 2.0]}))[["low", "high"]].isna().all(axis=None)


def test_bins_average_steps():
    curve = summarise_curve(rows({("a", 0): list(range(100))}, steps=range(1, 101)), bins=10)
    assert len(curve) == 10
    assert curve["mean"].tolist() == pytest.approx([4.5 + 10 * k for k in range(10)])


def test_success_is_that_of_the_last_tenth_of_each_agents_steps():
    """One agent succeeds at last; another, whose run is longer, no more; two seeds of a task count as one task."""
    late = [0.0] * 9 + [1.0]
    some = series({("a", 0): late, ("a", 1): late, ("b", 0): [1.0] * 18 + [0.5] * 2}, [], steps=range(1, 21))
    assert success_note([some, series({}, [("a", 0)])]) == ["success in the last tenth of training: SAC 75 %"]
    assert success_note([series({}, [("a", 0)])]) == []


def test_missing_runs_are_named():
    some = series({("a", 0): [1.0, 1.0]}, [("a", 0), ("a", 1)])
    assert missing_note([some]) == ["not there yet – SAC: a seed 1"]
    assert missing_note([series({}, [("a", 0)])]) == ["not there yet – SAC: all runs"]
    assert missing_note([series({("a", 0): [1.0, 1.0]}, [("a", 0)])]) == []
    many = series({("a", 0): [1.0, 1.0]}, [("a", seed) for seed in range(5)])
    assert missing_note([many]) == ["not there yet – SAC: 4 runs"]


def test_tasks_behind_an_incomplete_mean_are_named():
    """A mean over one of two tasks is not the mean over both."""
    both = [(task, seed) for task in ("a", "b") for seed in (0, 1)]
    line = [1.0, 1.0]
    assert tasks_note([series(dict.fromkeys(both, line), both)]) == []
    one = series({("a", 0): line, ("a", 1): line}, both)
    assert tasks_note([one]) == ["mean over the tasks that are there – SAC: a"]
    uneven = series({("a", 0): line, ("a", 1): line, ("b", 1): line}, both)
    assert tasks_note([uneven]) == ["mean over the tasks that are there – SAC: a, b (not of every seed)"]
    assert tasks_note([series({}, both)]) == [], "nothing there is no mean"
    assert tasks_note([series({("a", 0): line}, [("a", 0), ("a", 1)])]) == [], "one task alone is no mean over tasks"


def test_target_stands_in_the_title_and_on_no_curve():
    axes = new_figure(2, 2).subplots()
    draw_curves(axes, [series({("a", 0): [0.1, 0.8]}, [])], "velocity", 0.8)
    assert [text.get_text() for text in axes.texts] == []
    assert curve_title("velocity", 0.8, []) == "Velocity, target 0.8"
    assert curve_title("action_norm", None, []) == "Action norm"


def test_the_title_says_how_many_seeds():
    one, two = series({("a", 0): [1.0]}, []), series({("a", 0): [1.0], ("b", 0): [1.0], ("a", 1): [1.0]}, [])
    assert curve_title("velocity", 0.8, [two, two]) == "Velocity, target 0.8, n = 2"
    assert curve_title("velocity", None, [one, two]) == "Velocity, n = 1 to 2"
    assert curve_title("velocity", None, [two, series({}, [("a", 0)])]) == "Velocity, n = 2", "nothing is no mean"


def test_counts_differ_by_method():
    one, two = series({("a", 0): [1.0]}, []), series({("a", 0): [1.0], ("a", 1): [1.0]}, [])
    assert counts([two, two]) == "n = 2 seeds"
    assert counts([two, Series("Expert", LOOKS["expert"], one.rows, ())]) == "n = 2 seeds (SAC), 1 seed (Expert)"


def test_target_stays_in_sight_when_an_interval_is_huge():
    axes = new_figure(2, 2).subplots()
    draw_curves(axes, [series({("a", 0): [0.1, 0.1], ("a", 1): [0.7, 0.7]}, [])], "velocity", 0.8)
    assert axes.get_ylim() == pytest.approx((0, 0.96))
    assert any(np.allclose(line.get_ydata(), 0.8) for line in axes.lines)


def test_panel_without_runs_says_so():
    axes = new_figure(2, 2).subplots()
    draw_curves(axes, [series({}, [("a", 0)])], "velocity", 0.8)
    assert "no runs yet" in [text.get_text() for text in axes.texts]
    axes = new_figure(2, 2).subplots()
    draw_curves(axes, [series({}, [])], "velocity", 0.8)
    assert "not part of this study" in [text.get_text() for text in axes.texts]
