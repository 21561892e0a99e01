"""The family, its planner and its controls."""

import numpy as np
import pytest
import torch

from mtcsirl.validation.agents import demonstrate
from mtcsirl.validation.planner import Planner
from mtcsirl.validation.point_mass import (
    ARRIVED,
    EPISODE_STEPS,
    STEP,
    PointMasses,
    common_sense_reward,
    move,
    random_states,
    speed,
    task_reward,
    uniform_transitions,
)
from mtcsirl.validation.recovery import DISCOUNT, UNSEEN, potentials


@pytest.fixture(scope="module")
def planners() -> dict[str, Planner]:
    return {"expert": Planner(DISCOUNT), "task_only": Planner(DISCOUNT, cs_weight=0.0)}


def test_full_speed_ahead_goes_one_step_along_the_heading() -> None:
    state = np.array([0.1, 0.2, 0.0, 1.0])
    assert move(state, np.array([0.0, 1.0])) == pytest.approx([0.1, 0.2 + STEP, 0.0, 1.0])
    assert move(state, np.array([0.3, -1.0]))[:2] == pytest.approx([0.1, 0.2])


def test_the_state_does_not_tell_the_task() -> None:
    first, second = PointMasses([(0.5, 0.0)], 3), PointMasses([(-0.5, 0.2)], 3)
    assert np.array_equal(first.reset(), second.reset())
    action = np.array([[0.3, 0.4]])
    one, other = first.step(action), second.step(action)
    assert np.array_equal(one.next_observation, other.next_observation)
    assert one.task_reward != other.task_reward


def test_speed_is_the_second_action_and_the_truth_is_highest_at_its_target() -> None:
    moves = uniform_transitions(200, UNSEEN, np.random.default_rng(0))
    torch.testing.assert_close(speed(moves), (1.0 + moves.action[:, 1]) / 2.0, rtol=0, atol=1e-5)
    assert speed(moves)[common_sense_reward(moves).argmax()] == pytest.approx(0.8, abs=0.02)


def test_a_potential_is_removed_whole_and_the_truth_stays() -> None:
    from mtcsirl.results.correlation import remove

    moves = uniform_transitions(2_000, UNSEEN, np.random.default_rng(0))
    (x, y, cos, _), (x2, y2, cos2, _) = moves.observation.numpy().T, moves.next_observation.numpy().T
    shaping = DISCOUNT * (x2**2 * y2 - 3 * x2 * cos2) - (x**2 * y - 3 * x * cos)
    columns, truth = potentials(moves), common_sense_reward(moves).double().numpy()
    assert np.std(remove(shaping.astype(float), columns)) < 1e-5 * np.std(shaping)
    assert np.std(remove(truth, columns)) > 0.5 * np.std(truth)


def test_the_expert_goes_to_any_goal_at_its_speed(planners) -> None:
    moves = demonstrate(planners["expert"], [(0.4, -0.3), (-0.6, 0.5)], 20, 0)
    late = moves.task_reward.view(2, 20, EPISODE_STEPS)[..., -10:]
    assert (late.mean(dim=(1, 2)) > -2 * 2 * ARRIVED).all()
    assert speed(moves).mean(1).tolist() == pytest.approx([0.76, 0.76], abs=0.03)


def test_the_common_sense_is_what_makes_the_difference(planners) -> None:
    pace = {name: speed(demonstrate(one, [UNSEEN], 20, 0)) for name, one in planners.items()}
    assert pace["expert"].mean() - pace["task_only"].mean() > 0.2
    assert pace["expert"].std() < 0.6 * pace["task_only"].std()


def test_a_planner_earns_more_soft_reward_than_its_neighbour(planners) -> None:
    """By more than entropies explain: uniform speeds have 0.6 nats more per step than the expert's, 6 discounted."""
    random = np.random.default_rng(1)
    start = random_states(200, random)
    total = {}
    for name, planner in planners.items():
        state, total[name] = start, 0.0
        for step in range(40):
            action = planner.act(state, UNSEEN, random)
            following = move(state, action)
            pace = (1.0 + action[:, 1]) / 2.0
            reward = task_reward(following, np.array(UNSEEN)) - 20.0 * (pace - 0.8) ** 2
            total[name] += DISCOUNT**step * reward.mean()
            state = following
    assert total["expert"] - total["task_only"] > 10.0
