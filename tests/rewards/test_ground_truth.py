"""The common-sense rewards against numbers worked out by hand."""

import numpy as np
import pytest
import torch

from mtcsirl.rewards.ground_truth import COMMON_SENSE_REWARDS, CommonSenseReward, action_norm, velocity
from mtcsirl.transitions import Transitions
from mtcsirl.worlds.environments import OBSERVATION_MAPS, STEP_SECONDS, make_environment


def transitions(*, hand: list[float], previous_hand: list[float], action: list[float]) -> Transitions:
    after = torch.zeros(39)
    after[0:3], after[18:21] = torch.tensor(hand), torch.tensor(previous_hand)
    return Transitions(torch.zeros(39), torch.tensor(action), after, torch.zeros(()))


def test_velocity_is_metres_per_second() -> None:
    # 3 mm and 4 mm make 5 mm in 0.0125 s.
    moved = transitions(hand=[0.003, 0.604, 0.2], previous_hand=[0.0, 0.6, 0.2], action=[0.0] * 4)
    assert velocity(moved).item() == pytest.approx(0.4, rel=1e-4)
    assert COMMON_SENSE_REWARDS["velocity"](moved).item() == pytest.approx(-0.4, rel=1e-4)


def test_one_centimetre_a_step_is_the_papers_target() -> None:
    moved = transitions(hand=[0.0, 0.61, 0.2], previous_hand=[0.0, 0.6, 0.2], action=[0.0] * 4)
    assert COMMON_SENSE_REWARDS["velocity"](moved).item() == pytest.approx(0.0, abs=2e-5)


def test_action_norm_counts_the_gripper() -> None:
    acted = transitions(hand=[0.0] * 3, previous_hand=[0.0] * 3, action=[0.5, -1.0, 0.25, -0.5])
    assert action_norm(acted).item() == 2.25
    assert COMMON_SENSE_REWARDS["action_norm"](acted).item() == -0.75


def test_weight_multiplies_the_distance() -> None:
    acted = transitions(hand=[0.0] * 3, previous_hand=[0.0] * 3, action=[1.0] * 4)
    assert CommonSenseReward("x", action_norm, target=3.0, unit="", weight=2.5)(acted).item() == -2.5


def test_targets_are_the_papers() -> None:
    assert {name: reward.target for name, reward in COMMON_SENSE_REWARDS.items()} == {
        "velocity": 0.8,
        "action_norm": 3.0,
    }


@pytest.mark.parametrize("name", COMMON_SENSE_REWARDS)
def test_registry_entries_keep_leading_dimensions(name: str) -> None:
    reward = COMMON_SENSE_REWARDS[name]
    batch = Transitions(torch.rand(2, 5, 39), torch.rand(2, 5, 4), torch.rand(2, 5, 39), torch.rand(2, 5))
    assert reward.name == name
    assert reward(batch).shape == (2, 5)
    assert (reward(batch) <= 0).all()
    one = Transitions(*(part[1, 3] for part in batch))
    assert reward(batch)[1, 3] == reward(one)


@pytest.mark.parametrize("observation", ["raw", "mapped"])
def test_velocity_survives_float32_and_the_map(observation: str) -> None:
    environment = make_environment("reach", 0, observation=observation)
    observation_map = OBSERVATION_MAPS[observation]
    environment.reset()
    hand = environment.simulator.get_endeff_pos()
    random = np.random.default_rng(0)
    before = hand.copy()
    for _ in range(50):
        seen = environment.step(random.uniform(-1, 1, 4).astype(np.float32))[0]
        speed = np.linalg.norm(hand - before) / STEP_SECONDS
        after = observation_map.invert(torch.from_numpy(seen))
        measured = velocity(Transitions(after, torch.zeros(4), after, torch.zeros(())))
        assert measured.item() == pytest.approx(speed, abs=2e-5)
        before = hand.copy()
