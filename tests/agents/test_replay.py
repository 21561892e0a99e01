"""Replay: what goes in comes out, in order and while it lasts; rewards are computed on sampling."""

import numpy as np
import pytest
import torch

from mtcsirl.agents.replay import Replay
from mtcsirl.rewards.adapter import ground_truth
from mtcsirl.rewards.mixture import PolicyReward, RewardMixture
from mtcsirl.worlds.environments import OBSERVATION_MAPS
from tests.agents.made_up import random_transitions

AGENTS = 2


def add(replay, step):
    """Every number of a transition says its agent and its step."""
    code = np.arange(AGENTS, dtype=np.float32) * 1000 + step
    replay.add(
        np.repeat(code[:, None], 39, 1), np.repeat(code[:, None], 4, 1), np.repeat(code[:, None] + 0.5, 39, 1), code
    )


def filled(steps, capacity=50):
    replay = Replay(range(AGENTS), capacity)
    for step in range(steps):
        add(replay, step)
    return replay


@pytest.mark.parametrize(("steps", "recent", "oldest"), [(30, None, 0), (120, None, 70), (120, 7, 113), (5, 99, 0)])
def test_samples_whole_rows_of_the_own_agent_within_the_window(steps, recent, oldest):
    batch = filled(steps).sample(2000, recent)
    codes = batch.task_reward
    assert codes.shape == (AGENTS, 2000)
    assert torch.equal(batch.observation, codes[..., None].expand(-1, -1, 39))
    assert torch.equal(batch.action, codes[..., None].expand(-1, -1, 4))
    assert torch.equal(batch.next_observation, codes[..., None].expand(-1, -1, 39) + 0.5)
    for agent in range(AGENTS):
        assert set((codes[agent] - 1000 * agent).tolist()) == set(range(oldest, steps))


def test_latest_is_in_order_also_across_the_seam():
    assert filled(120).latest(30).task_reward[1].tolist() == [1000 + step for step in range(90, 120)]


def test_empty_memory_and_too_many_steps_are_errors():
    with pytest.raises(ValueError, match="empty"):
        Replay([0], 5).sample(3)
    with pytest.raises(ValueError, match="last 9 of 5"):
        filled(5).latest(9)


@pytest.mark.parametrize("steps", [30, 120])
def test_restored_memory_draws_the_same(steps):
    replay, restored = filled(steps), Replay(range(AGENTS), 50)
    replay.sample(3)
    for agent in range(AGENTS):
        state = {name: tensor.clone() for name, tensor in replay.state_dict(agent).items()}
        restored.load_state_dict(agent, state)
    for one in (replay, restored):
        add(one, 999)
    assert torch.equal(replay.sample(64).observation, restored.sample(64).observation)


def test_reward_of_every_sampled_row_is_the_mixture_computed_on_that_row():
    first = ground_truth("velocity", "mapped")

    def second(transitions):
        return transitions.action.sum(-1)

    mixtures = [
        RewardMixture(scale=0.1, cs_weight=2.0, curriculum=True, f=first),
        RewardMixture(scale=3.0, cs_weight=5.0, f=second),
        RewardMixture(scale=0.5),
        RewardMixture(cs_weight=1.0, f=first, task_reward=second),
    ]
    reward = PolicyReward(mixtures, "cpu")
    for step in range(300):
        reward.alpha.add(torch.full((4,), float(step >= 100)) * 6.0)
    batch = random_transitions(4, 16)
    alpha = 6.0 * 200 / 256 / 10.0
    mapping = OBSERVATION_MAPS["mapped"]
    values = reward(batch)
    for row in range(16):
        after = mapping.invert(batch.next_observation[:, row])
        speed = (after[:, :3] - after[:, 18:21]).norm(dim=-1) / 0.0125
        cs = -(speed - 0.8).abs()
        task, actions = batch.task_reward[:, row], batch.action[:, row].sum(-1)
        expected = [
            0.1 * (task[0] + 2.0 * alpha * cs[0]),
            3.0 * (task[1] + 5.0 * actions[1]),
            0.5 * task[2],
            actions[3] + cs[3],
        ]
        torch.testing.assert_close(values[:, row], torch.stack(expected), rtol=1e-4, atol=1e-4)


def test_f_counts_only_for_agents_whose_warm_up_is_over():
    def f(transitions):
        return transitions.action.sum(-1)

    reward = PolicyReward([RewardMixture(cs_weight=2.0, f=f)] * 2, "cpu")
    reward.counts[0] = False
    batch = random_transitions(2, 8)
    torch.testing.assert_close(reward(batch)[0], batch.task_reward[0])
    torch.testing.assert_close(reward(batch)[1], batch.task_reward[1] + 2.0 * f(batch)[1])
    reward.counts[:] = False
    torch.testing.assert_close(reward(batch), batch.task_reward)


def test_reward_shared_by_all_agents_is_computed_for_one_after_the_other():
    """The same network gives the same rows other bits when there are more of them."""
    shapes = []

    def f(transitions):
        shapes.append(transitions.action.shape)
        return transitions.action.sum(-1)

    batch = random_transitions(3, 8)
    reward = PolicyReward([RewardMixture(cs_weight=1.0, f=f)] * 3, "cpu")
    torch.testing.assert_close(reward(batch), batch.task_reward + batch.action.sum(-1))
    assert shapes == [(1, 8, 4)] * 3
