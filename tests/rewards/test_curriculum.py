"""alpha = r_ave / R_MAX by hand."""

import pytest
import torch

from mtcsirl.rewards.curriculum import Curriculum


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
