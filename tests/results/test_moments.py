"""Partial correlations across policies, held against pingouin and against studies whose answer is known."""

import numpy as np
import pandas as pd
import pingouin
import pytest

from mtcsirl.results.moments import beyond_task, correlations, episode_sums, given_task
from mtcsirl.results.statistics import mean_correlation
from tests.claims.made_up import points, rewards


def one_reward(partial=0.5, make=rewards, spread=0.05):
    frame = points({"single_target": partial, "multi_task": partial}, make=make, spread=spread)
    own = (frame["experiment"] == "multi_task") & (frame["cs_reward"] == "velocity") & (frame["task"] == "push-back")
    return frame[own].reset_index(drop=True)


def test_partial_correlation_equals_pingouin():
    frame = one_reward()
    one = frame[frame["seed"] == 0]
    theirs = pingouin.partial_corr(one, x="learned", y="truth", covar="task_reward")["r"].iloc[0]
    sums = episode_sums(one).iloc[:, 4:].to_numpy().sum(axis=0)
    assert float(correlations(sums).partial) == pytest.approx(theirs, abs=1e-6)
    r = one[["learned", "truth", "task_reward"]].corr().to_numpy()
    assert float(given_task(*(np.array(x) for x in (r[0, 1], r[0, 2], r[1, 2])))) == pytest.approx(theirs, abs=1e-6)
    assert float(correlations(sums).raw) == pytest.approx(r[0, 1])
    assert float(correlations(sums).beyond) == pytest.approx(r[0, 1] + r[1, 2])


def test_means_over_seeds_and_counts():
    found = beyond_task(one_reward(0.5), np.random.default_rng(0), resamples=200)
    assert found.partial.value == pytest.approx(0.5, abs=0.05)
    assert found.partial.low < found.partial.value < found.partial.high
    assert (found.partial.n, found.agents, found.episodes) == (5, 15, 70)
    again = beyond_task(one_reward(0.5).sample(frac=1.0, random_state=1), np.random.default_rng(0), resamples=200)
    assert again.partial == pytest.approx(found.partial, abs=1e-9), "the order of rows decides nothing"
    one = one_reward(0.5)
    alone = beyond_task(one[one["seed"] == 0], np.random.default_rng(0), resamples=50)
    assert alone.partial.n == 1
    assert np.isnan(alone.partial.low)


def test_every_policy_counts_alike_whatever_its_numbers():
    """Ten copies of the uniform actions change nothing, and `across` rows are no fifth policy."""
    frame = one_reward()
    uniform = frame[frame["transitions"] == "uniform"]
    copies = [uniform.assign(episode=uniform["episode"] + 100 * (k + 1)) for k in range(9)]
    across = frame.assign(transitions="across", learned=0.0)
    first, second = (
        beyond_task(one, np.random.default_rng(0), resamples=20).partial.value
        for one in (frame, pd.concat([frame, *copies, across], ignore_index=True))
    )
    assert first == pytest.approx(second, abs=1e-12)


def test_units_of_the_rewards_do_not_matter():
    frame = one_reward()
    other = frame.assign(learned=1e4 + 300 * frame["learned"], task_reward=0.01 * frame["task_reward"] - 50)
    first, second = (beyond_task(one, np.random.default_rng(0), resamples=50) for one in (frame, other))
    assert first.partial == pytest.approx(second.partial, abs=1e-6)
    assert first.beyond == pytest.approx(second.beyond, abs=1e-6)


def test_what_cannot_be_said_is_nan():
    frame = one_reward()
    for learned in (-frame["task_reward"], 0.0 * frame["truth"]):
        found = beyond_task(frame.assign(learned=learned), np.random.default_rng(0), resamples=20)
        assert np.isnan(found.partial.value)
    constant = beyond_task(frame.assign(task_reward=3.0), np.random.default_rng(0), resamples=20)
    assert constant.partial.value == pytest.approx(constant.raw.value), "a task reward that never varies explains none"


def test_agents_that_all_seeds_share_widen_the_interval():
    """Each agent's own slope in all five seeds: seeds agree, and yet five other agents would say another thing."""
    generator = np.random.default_rng(3)
    sets = [(name, agent, 2 * agent + e) for name in ("sac", "expert") for agent in range(3) for e in (0, 1)]
    sets += [(name, 0, e) for name in ("generator", "uniform") for e in (0, 1)]
    slopes = {(name, agent): generator.normal(0.0, 2.0) for name, agent, _ in sets}
    frames = []
    for seed in range(5):
        for name, agent, episode in sets:
            c, t, noise = generator.normal(size=(3, 60))
            learned = slopes[name, agent] * c + noise
            own = {"seed": seed, "transitions": name, "agent": agent, "episode": episode}
            frames.append(pd.DataFrame({**own, "learned": learned, "truth": c, "task_reward": t}))
    study = pd.concat(frames, ignore_index=True)
    found = beyond_task(study, np.random.default_rng(0), resamples=300).partial
    alone = [
        beyond_task(study[study["seed"] == k], np.random.default_rng(0), resamples=2).partial.value for k in range(5)
    ]
    by_seeds = mean_correlation(alone)
    assert found.value == pytest.approx(by_seeds.value)
    assert found.high - found.low > 2 * (by_seeds.high - by_seeds.low)
