"""alpha = r_ave / R_MAX by hand."""

import pytest
import torch

from mtcsirl.rewards.curriculum import Alpha, Curriculum
from mtcsirl.rewards.mixture import PolicyReward, RewardMixture
from mtcsirl.settings.loading import load
from mtcsirl.settings.runs import expert_run


def test_no_weight_before_the_first_step() -> None:
    assert Curriculum(3).weight().tolist() == [0.0, 0.0, 0.0]


def test_mean_of_the_last_window_of_each_generator_over_ten() -> None:
    curriculum = Curriculum(2, window=4)
    for reward in (10.0, 2.0, 4.0):
        curriculum.add(torch.tensor([reward, 0.0]))
    assert curriculum.weight()[0].item() == pytest.approx(16.0 / 3 / 10)  # not yet a full window
    for reward in (6.0, 8.0):  # the 10 falls out: (2 + 4 + 6 + 8) / 4 / 10
        curriculum.add(torch.tensor([reward, 1.0]))
    assert curriculum.weight().tolist() == pytest.approx([0.5, 0.05])


def test_the_papers_window_and_its_largest_reward_give_full_weight() -> None:
    curriculum = Curriculum(1)
    for _ in range(256):
        curriculum.add(torch.tensor([0.0]))
    assert curriculum.weight().item() == 0.0
    for _ in range(256):
        curriculum.add(torch.tensor([10.0]))
    assert curriculum.weight().item() == pytest.approx(1.0)


def test_each_generator_over_a_maximum_of_its_own_and_never_more_than_full_weight() -> None:
    curriculum = Curriculum(4, window=2, maximum=torch.tensor([8.0, 4.0, 2.0, 0.0]))
    curriculum.add(torch.tensor([3.0, 3.0, 3.0, 0.5]))
    curriculum.add(torch.tensor([1.0, 1.0, 1.0, 0.5]))
    assert curriculum.weight().tolist() == pytest.approx([0.25, 0.5, 1.0, 1.0])


def test_alpha_is_the_weight_times_the_curriculum_of_those_that_have_one() -> None:
    alpha = Alpha([20.0, 3.0, 5.0], [True, False, True], window=2, maximum=8.0)
    assert alpha().tolist() == [0.0, 3.0, 0.0], "before the first step"
    alpha.add(torch.tensor([2.0, 2.0, 16.0]))
    alpha.add(torch.tensor([4.0, 4.0, 0.0]))
    assert alpha().tolist() == pytest.approx([20.0 * 3 / 8, 3.0, 5.0])
    constant = Alpha([2.0], [False], window=2, maximum=8.0)
    constant.add(torch.tensor([4.0]))
    assert constant().tolist() == [2.0]


def test_the_state_of_one_agent_restores_its_alpha_in_any_batch() -> None:
    def made(agents: int) -> Alpha:
        return Alpha([2.0] * agents, [True, False, True][:agents], window=3, maximum=10.0)

    batch, alone = made(3), made(1)
    for step in range(5):
        batch.add(torch.tensor([float(step), 1.0, 5.0]))
    assert batch.state_dict(1) == {}, "none without a curriculum"
    alone.load_state_dict(0, {name: tensor.clone() for name, tensor in batch.state_dict(0).items()})
    for one, rewards in ((batch, [9.0, 0.0, 0.0]), (alone, [9.0])):
        one.add(torch.tensor(rewards))
    assert torch.equal(batch()[:1], alone())


def test_an_experts_curriculum_is_that_of_its_settings() -> None:
    own = expert_run(
        load(overrides=["expert.curriculum_window=64", "expert.curriculum_maximum=5.0"]), "reach", "velocity"
    )
    assert (own.curriculum_window, own.curriculum_maximum) == (64, 5.0)
    mixture = [RewardMixture(cs_weight=1.0, curriculum=True, f=lambda transitions: transitions.task_reward)]
    reward = PolicyReward(mixture, window=own.curriculum_window, maximum=own.curriculum_maximum)
    for step in range(128):
        reward.alpha.add(torch.tensor([4.0 if step >= 64 else 0.0]))
    assert reward.alpha().item() == pytest.approx(0.8)
