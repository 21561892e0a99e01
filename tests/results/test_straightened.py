"""What is left of rewards beside any function of the task reward, where that is known."""

import numpy as np
import pandas as pd
import pytest

from mtcsirl.results.straightened import within_tenths


def points(f, c, t, seed=0, transitions="sac"):
    return pd.DataFrame({"seed": seed, "transitions": transitions, "learned": f, "truth": c, "task_reward": t})


def test_a_function_of_the_task_reward_leaves_nothing_and_the_rest_stays():
    t, own = np.random.default_rng(0).normal(size=(2, 5000))
    left = within_tenths(points(np.exp(t), np.sin(3 * t) + own, t))
    assert (left["learned"] == 0).all()
    assert (left["task_reward"] == 0).all()
    assert np.corrcoef(left["truth"], own)[0, 1] == pytest.approx(1, abs=0.01)


def test_each_seed_has_its_own_function():
    t, own = np.random.default_rng(1).normal(size=(2, 2000))
    both = pd.concat([points(t**2 + own, own, t), points(-(t**2) + own, own, t, seed=1)], ignore_index=True)
    left = within_tenths(both)
    for _, part in left.groupby("seed"):
        assert np.corrcoef(part["learned"], own)[0, 1] == pytest.approx(1, abs=0.02)


def test_a_task_reward_that_hardly_takes_values_is_no_trouble():
    own = np.random.default_rng(2).normal(size=(2, 200))
    left = within_tenths(points(own[0] + 3, own[1], np.repeat([0.0, 10.0], 100)))
    assert left["learned"].groupby(np.repeat([0, 1], 100)).mean().to_numpy() == pytest.approx(0, abs=1e-9)
    assert np.isfinite(left[["learned", "truth"]]).all(axis=None)


def test_small_sets_of_transitions_weigh_as_much_as_large_ones():
    """A curve fitted to the large set alone would leave the small set's own mean in it."""
    t = np.linspace(0, 1, 400)
    large, small = points(0 * t, t, t), points(np.ones(40), t[::10], t[::10], transitions="expert")
    left = within_tenths(pd.concat([large, small], ignore_index=True))
    means = left["learned"].groupby(left["transitions"]).mean()
    assert means["sac"] == pytest.approx(-0.5, abs=0.1)
    assert means["expert"] == pytest.approx(0.5, abs=0.1)
