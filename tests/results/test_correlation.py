import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats

from mtcsirl.results.correlation import (
    epic_distance,
    epic_values,
    nuisance,
    partial_correlation,
    pearson,
    remove,
    spearman,
    views,
)
from mtcsirl.transitions import Transitions

DISCOUNT = 0.9
floats = st.floats(-10, 10).map(lambda x: round(x, 2))


@pytest.fixture
def transitions():
    random = torch.Generator().manual_seed(0)
    observation, after = torch.randn(400, 39, generator=random), torch.randn(400, 39, generator=random)
    observation[:, 30:] = after[:, 30:] = 0.5  # Meta-World has constant entries
    action = torch.rand(400, 4, generator=random) * 2 - 1
    return Transitions(observation, action, after, 10 * torch.rand(400, generator=random))


def truth(t):
    return -(t.action.abs().sum(-1) - 3).abs()


def potential(observation):
    return 3 * observation[..., 0] - 2 * observation[..., 7]


def shaped(t):
    """A reward with the same optimal behaviour beside the task reward: scaled, offset, shaped, r_task added."""
    shaping = DISCOUNT * potential(t.next_observation) - potential(t.observation)
    return 0.5 * truth(t) - 2 + 0.7 * t.task_reward + shaping


def arrays(transitions, *rewards):
    return [reward(transitions).double().numpy() for reward in rewards]


@given(st.lists(st.tuples(floats, floats), min_size=3, max_size=30))
def test_equal_scipy(pairs):
    x, y = np.array(pairs, dtype=float).T
    if np.ptp(x) < 0.01 or np.ptp(y) < 0.01:
        return
    assert pearson(x, y) == pytest.approx(stats.pearsonr(x, y).statistic, abs=1e-9)
    assert spearman(x, y) == pytest.approx(stats.spearmanr(x, y).statistic, abs=1e-9)


def test_what_does_not_vary_has_no_correlation():
    assert np.isnan(pearson(np.zeros(5), np.arange(5.0)))
    assert np.isnan(spearman(np.full(5, 0.1), np.arange(5.0)))


@given(st.lists(st.tuples(floats, floats, floats), min_size=5, max_size=30))
def test_partial_correlation_is_that_of_what_a_line_in_t_leaves(triples):
    f, c, t = np.array(triples, dtype=float).T
    line = np.column_stack([np.ones_like(t), t])
    rest = [x - line @ np.linalg.lstsq(line, x, rcond=None)[0] for x in (f, c)]
    if min(np.std(rest[0]), np.std(rest[1]), np.std(t)) < 0.05:
        return
    assert partial_correlation(f, c, t) == pytest.approx(stats.pearsonr(*rest).statistic, abs=1e-6)


def test_partial_correlation_sees_what_r_hides():
    """f = -r_task correlates with a truth that slow policies please, and says nothing beyond r_task."""
    random = np.random.default_rng(0)
    t, own = random.normal(size=(2, 500))
    truth = own - 2 * t
    assert pearson(-t, truth) > 0.85
    assert np.isnan(partial_correlation(-t, truth, t))
    assert np.isnan(partial_correlation((3 - 0.7 * t).astype(np.float32).astype(float), truth, t.astype(np.float32)))
    assert partial_correlation(own - t, truth, t) == pytest.approx(1.0)
    assert partial_correlation(t - own, truth, t) == pytest.approx(-1.0)
    noise = random.normal(size=500)
    assert abs(partial_correlation(noise - 5 * t, truth, t)) < 0.1


def test_partial_correlation_where_something_does_not_vary():
    x, y, one = np.arange(6.0), np.array([1.0, 0, 2, 5, 3, 4]), np.ones(6)
    assert partial_correlation(x, y, one) == pearson(x, y), "r_task that does not vary explains nothing"
    assert np.isnan(partial_correlation(one, y, x))
    assert np.isnan(partial_correlation(x, one, y))
    assert np.isnan(partial_correlation(one, one, x))


def test_removal_finds_the_truth_under_task_reward_and_shaping(transitions):
    learned, true = arrays(transitions, shaped, truth)
    both = views(learned, true, transitions, DISCOUNT)
    value = {name: measure(*vectors) for name, (measure, vectors) in both.parts.items()}
    assert value["pearson"] < 0.4
    assert value["pearson_residual"] == pytest.approx(1.0, abs=1e-6)
    assert value["spearman_residual"] == pytest.approx(1.0, abs=1e-4)


def test_removal_leaves_nothing_of_pure_shaping_and_task_reward(transitions):
    learned, true = arrays(transitions, lambda t: shaped(t) - 0.5 * truth(t), truth)
    both = views(learned, true, transitions, DISCOUNT)
    measure, vectors = both.parts["pearson_residual"]
    assert np.isnan(measure(*vectors))


def test_removal_with_the_wrong_discount_leaves_some(transitions):
    learned, true = arrays(transitions, shaped, truth)
    measure, vectors = views(learned, true, transitions, 0.5).parts["pearson_residual"]
    assert measure(*vectors) < 0.9


def test_residual_is_orthogonal_to_what_was_removed(transitions):
    columns = nuisance(transitions, DISCOUNT)
    rest = remove(truth(transitions).double().numpy(), columns)
    assert np.abs(columns.T @ rest).max() < 1e-6


def test_epic_is_blind_to_any_potential_and_to_scale(transitions):
    def bent(t):
        h = lambda s: s[..., 1] ** 2 - s[..., 2] * s[..., 3]  # noqa: E731
        return 2 * truth(t) + DISCOUNT * h(t.next_observation) - h(t.observation) + 5

    values = [epic_values(r, transitions, DISCOUNT, np.random.default_rng(0)) for r in (bent, truth)]
    assert epic_distance(*values) < 0.01
    plain = arrays(transitions, bent, truth)
    assert epic_distance(*plain) > 0.3, "without canonical shaping the potential hides the truth"


@pytest.mark.parametrize(("reward", "expected"), [(truth, 0.0), (lambda t: -truth(t), 1.0)])
def test_epic_of_known_rewards(transitions, reward, expected):
    values = [epic_values(r, transitions, DISCOUNT, np.random.default_rng(0)) for r in (reward, truth)]
    assert epic_distance(*values) == pytest.approx(expected, abs=1e-3)


def test_epic_of_an_unrelated_reward_is_half_a_root(transitions):
    values = [
        epic_values(r, transitions, DISCOUNT, np.random.default_rng(0))
        for r in (lambda t: t.observation[..., 5], truth)
    ]
    assert epic_distance(*values) == pytest.approx(np.sqrt(0.5), abs=0.06) or np.isnan(epic_distance(*values))


def test_intervals_come_from_whole_episodes(transitions):
    learned, true = arrays(transitions, shaped, truth)
    both, episodes = views(learned, true, transitions, DISCOUNT), np.arange(400) // 40
    estimate = both.estimate("pearson", episodes, np.random.default_rng(0), 200)
    assert estimate.n == 10
    assert estimate.low < estimate.value < estimate.high
    assert np.isnan(both.estimate("pearson", episodes, np.random.default_rng(0), 0).low)
    assert np.isnan(both.estimate("pearson", np.zeros(400), np.random.default_rng(0), 50).low)
