"""What a learned reward says of itself, and what is refused: other kinds, and numbers that are none."""

import json

import numpy as np
import pytest
import torch

from mtcsirl.errors import UserError
from mtcsirl.files import storage
from mtcsirl.rewards.learned import LearnedReward, check_learned, load_learned_reward, save_learned_reward
from mtcsirl.rewards.networks import RewardNetwork

ARCHITECTURE = {
    "kind": "perceptron", "observation_size": 39, "action_size": 4, "hidden_sizes": [8],
    "output_scale": 10.0, "shaping": False, "discount": 0.99,
}  # fmt: skip


def learned(members=(("reach", 1), ("door-close", 1)), **about):
    network = RewardNetwork(ARCHITECTURE, random=torch.Generator().manual_seed(7))
    return LearnedReward(network, "mt_csirl", "velocity", "mapped", members, about=about)


@pytest.mark.parametrize(
    ("members", "experiment", "source"),
    [
        ((("reach", 0),), "single_target", "reach"),
        ((("reach", 1), ("reach", 2)), "multi_target", "reach"),
        ((("reach", 1), ("door-close", 1)), "multi_task", "all"),
    ],
)
def test_its_members_tell_the_experiment_unless_it_says_so_itself(members, experiment, source):
    assert (learned(members).experiment, learned(members).source) == (experiment, source)
    told = learned(members, experiment="mine", source="ours")
    assert (told.experiment, told.source) == ("mine", "ours")


def test_a_reward_of_another_kind_is_refused():
    mine = {"cs_reward": "velocity", "observation": "mapped", "method": "mt_csirl", "experiment": "multi_task"}
    check_learned(learned(), "irl/s0")
    check_learned(learned(), "irl/s0", **mine)
    for name, other in (
        ("cs_reward", "action_norm"), ("observation", "raw"), ("method", "mt_airl"), ("experiment", "multi_target")
    ):  # fmt: skip
        with pytest.raises(UserError, match=r"^irl/s0: learned .*" + mine[name]) as error:
            check_learned(learned(), "irl/s0", **mine | {name: other})
        assert "\n" not in str(error.value)


@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_weights_that_are_no_numbers_are_refused_though_their_checksum_is_right(tmp_path, value):
    reward = learned()
    save_learned_reward(reward, tmp_path / "good")
    load_learned_reward(tmp_path / "good")
    with torch.no_grad():
        reward.network.parameters[0, 5] = value
    save_learned_reward(reward, tmp_path)
    with pytest.raises(UserError, match=r"reward\.safetensors: f holds numbers that are not finite"):
        load_learned_reward(tmp_path)


@pytest.mark.parametrize("value", ["NaN", "Infinity"])
def test_an_offset_that_is_no_number_is_refused(tmp_path, value):
    save_learned_reward(learned(), tmp_path)
    description = json.loads((tmp_path / "reward.json").read_text())
    storage.write_text(tmp_path / "reward.json", json.dumps(description | {"offset": float(value)}))
    with pytest.raises(UserError, match=r"reward\.json: .* not finite"):
        load_learned_reward(tmp_path)
