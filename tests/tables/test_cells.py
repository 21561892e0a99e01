import numpy as np
import pandas as pd
import pytest

from mtcsirl.results.statistics import Summary
from mtcsirl.tables.cells import MARK_TEXTS, MARKS, make_cell

UNKNOWN = Summary(np.nan, np.nan, 0)


def rows(values, status="ok", tasks=("push-back",), metric="velocity"):
    """``values`` [seeds][tasks]; the deterministic policy is 0.1 slower."""
    table = []
    for seed, row in enumerate(values):
        for task, value in zip(tasks, row, strict=True):
            state = status if isinstance(status, str) else status[seed]
            for policy, shift in (("stochastic", 0.0), ("deterministic", -0.1)):
                table.append({"seed": seed, "task": task, "policy": policy, "kept": "kept", "metric": metric,
                              "value": value + shift, "status": state, "diverged": 0,
                              "folder": f"{task}/s{seed}"})  # fmt: skip
    return pd.DataFrame(table)


def test_seeds_are_averaged_after_tasks():
    """Std is that of the per-seed means (0.5, 0.6, 0.7), not of the six values."""
    cell = make_cell(rows([[0.4, 0.6], [0.5, 0.7], [0.6, 0.8]], tasks=("a", "b")), "velocity", UNKNOWN)
    assert cell.ours == pytest.approx((0.6, 0.1, 3))
    assert cell.interval == pytest.approx((0.6 - 0.24841, 0.6 + 0.24841), abs=1e-4)
    assert cell.deterministic == pytest.approx(0.5)
    assert cell.iqm.value == pytest.approx(np.mean([0.5, 0.6, 0.6, 0.7])), "of the six values, without the extremes"
    assert cell.iqm.low < cell.iqm.value < cell.iqm.high


def test_a_cell_knows_the_runs_that_count():
    cell = make_cell(rows([[0.4, 0.6], [np.nan, 0.7]], tasks=("a", "b")), "velocity", UNKNOWN)
    assert cell.folders == ("a/s0", "b/s0"), "nor is an agent whose seed lacks another task"
    assert cell.unaveraged == 1


def test_marks_that_speak_of_the_mean_are_of_agents_that_are_in_it():
    frame = rows([[0.4, 0.6], [100.0, np.nan]], tasks=("a", "b"))
    last = frame["seed"] == 1
    frame.loc[last & (frame["task"] == "a"), ["status", "diverged"]] = ["below gate", 1]
    frame.loc[last & (frame["task"] == "b"), "status"] = "missing"
    assert make_cell(frame, "velocity", UNKNOWN).marks == {"missing": 1}
    frame.loc[last & (frame["task"] == "b"), ["value", "status"]] = [0.7, "ok"]
    assert make_cell(frame, "velocity", UNKNOWN).marks == {"below": 1, "diverged": 1}


def test_inside_and_outside_the_papers_prediction_interval():
    paper = Summary(0.73, 0.07, 5)  # five new seeds: 0.61 to 0.85
    near, far = ([[m + d] for d in (-0.02, -0.01, 0, 0.01, 0.02)] for m in (0.64, 0.58))
    assert make_cell(rows(near), "velocity", paper).comparison == "inside"
    cell = make_cell(rows(far), "velocity", paper)
    assert cell.comparison == "outside"
    assert (cell.ours_text(), cell.paper_text()) == ("0.58±0.02 (n=5)", "0.73±0.07")
    assert (cell.interval_text(), cell.prediction_text()) == ("[0.56, 0.60]", "[0.61, 0.85]")


def test_an_interval_that_says_nothing_is_called_uninformative():
    """Inside by far, but the paper's spread is fifty times ours: the two are not of the same kind."""
    values = [[1.57 + d] for d in (-0.01, -0.005, 0, 0.005, 0.01)]
    assert make_cell(rows(values), "velocity", Summary(1.57, 0.48, 5)).comparison == "uninformative"
    assert make_cell(rows(values), "velocity", Summary(1.57, 0.05, 5)).comparison == "inside", "a sixfold spread is not"
    assert make_cell(rows(values), "velocity", Summary(1.57, np.nan, 5)).comparison == "uninformative", "no interval"
    assert make_cell(rows(values), "velocity", Summary(1.57, 0.0, 5)).comparison == "uninformative"
    assert make_cell(rows(values), "velocity", UNKNOWN).comparison == "", "nothing to compare with"
    assert make_cell(rows([[1.0]] * 5), "velocity", Summary(1.0, 0.1, 5)).comparison == "uninformative", "ours has none"


def test_ratio_divides_by_the_target():
    cell = make_cell(rows([[0.72], [0.76]]), "velocity", Summary(0.93, np.nan, 5), scale=0.8)
    assert cell.ours.mean == pytest.approx(0.925)
    assert (cell.paper_text(), cell.prediction_text()) == ("0.93", "–")


def test_percent_is_printed_as_percent():
    cell = make_cell(rows([[1.0], [0.9]], metric="success"), "success", Summary(0.635, 0.012, 5))
    assert cell.ours_text(1, 100.0) == "95.0±7.1 (n=2)"
    assert cell.paper_text(1, 100.0) == "63.5±1.20"
    assert cell.comparison == "outside"


def test_a_share_stays_between_0_and_1():
    cell = make_cell(rows([[1.0], [0.9], [1.0]], metric="success"), "success", Summary(0.99, 0.02, 5))
    assert cell.interval.low < 0.9
    assert (cell.interval.high, cell.prediction.high) == (1.0, 1.0)
    assert cell.comparison == "inside"


def test_spreads_of_the_paper_keep_their_digits():
    """Its 99.9±0.01 % is not 99.9±0.0 %, outside [99.9, 99.9]."""
    cell = make_cell(rows([[1.0]] * 5, metric="success"), "success", Summary(0.999, 0.0001, 5))
    assert (cell.paper_text(1, 100.0), cell.prediction_text(100.0)) == ("99.9±0.01", "[99.88, 99.92]")


def test_missing_doubtful_and_gated_agents_are_marked():
    status = ["ok", "missing", "duplicated", "below gate", "foreign"]
    values = [[0.7], [np.nan], [np.nan], [0.3], [np.nan]]
    cell = make_cell(rows(values, status), "velocity", UNKNOWN)
    assert (cell.ours.n, cell.expected) == (2, 5)
    assert cell.ours.mean == pytest.approx(0.5), "an agent below its gate counts"
    assert cell.marks == {"below": 1, "missing": 1, "doubtful": 2}
    assert cell.ours_text() == "0.50±0.28 (n=2)"


def test_what_is_left_out_and_what_diverged_is_marked():
    status = ["ok", "incomplete", "stale", "ok"]
    frame = rows([[0.7], [np.nan], [np.nan], [0.8]], status)
    frame.loc[frame["seed"] == 3, "diverged"] = 2
    cell = make_cell(frame, "velocity", UNKNOWN)
    assert cell.marks == {"incomplete": 1, "stale": 1, "diverged": 1}, "agents, not episodes"
    assert cell.ours.n == 2
    assert set(cell.marks) < set(MARKS) == set(MARK_TEXTS)
    assert make_cell(frame.assign(diverged=0), "velocity", UNKNOWN).marks == {"incomplete": 1, "stale": 1}


def test_the_kept_policy_is_the_one_that_is_shown():
    both = pd.concat([rows([[0.7], [0.8]]), rows([[0.1], [0.2]]).assign(kept="last")])
    assert make_cell(both, "velocity", UNKNOWN).ours.mean == pytest.approx(0.75)


def test_a_metric_that_was_not_recorded_is_a_dash():
    cell = make_cell(rows([[0.7], [0.8]]), "velocity_distance", UNKNOWN)
    assert (cell.ours_text(), cell.comparison, cell.expected, cell.marks) == ("–", "", 0, {})


def test_a_seed_without_one_of_its_tasks_has_no_mean():
    values = [[0.7, 0.9], [0.7, np.nan]]
    cell = make_cell(rows(values, tasks=("a", "b")), "velocity", UNKNOWN)
    assert cell.ours.n == 1
    assert cell.ours.mean == pytest.approx(0.8)


def test_nothing_there_is_a_dash_with_its_count():
    cell = make_cell(rows([[np.nan]] * 5, "missing"), "velocity", Summary(0.73, 0.07, 5))
    assert (cell.ours_text(), cell.interval_text(), cell.paper_text()) == ("–", "–", "0.73±0.07")
    assert (cell.comparison, cell.marks) == ("", {"missing": 5})
