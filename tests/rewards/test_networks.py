"""Reward networks and the artefact they are kept in."""

import json

import pytest
import torch

from mtcsirl.errors import UserError
from mtcsirl.rewards.learned import LearnedReward, load_learned_reward, save_learned_reward
from mtcsirl.rewards.networks import RewardNetwork, network_inputs
from mtcsirl.transitions import Transitions

ARCHITECTURE = {
    "kind": "perceptron",
    "observation_size": 2,
    "action_size": 1,
    "hidden_sizes": [2],
    "output_scale": 10.0,
    "shaping": False,
    "discount": 0.9,
}
BOTTLENECK = {**ARCHITECTURE, "kind": "bottleneck", "hidden_sizes": [4], "bottleneck_size": 3}
MEMBERS = (("reach", 1), ("drawer-close", 1))


@pytest.fixture(autouse=True)
def _same_numbers_every_time() -> None:
    torch.manual_seed(0)


def _transitions(*shape: int) -> Transitions:
    return Transitions(torch.randn(*shape, 2), torch.randn(*shape, 1), torch.randn(*shape, 2), torch.rand(*shape))


def _random() -> torch.Generator:
    return torch.Generator().manual_seed(0)


def test_perceptron_by_hand() -> None:
    # Hidden: relu(s1 + a), relu(-s'2); value = 2 h1 - h2 + 0.5; f = 10 value.
    weight = torch.zeros(5, 2)
    weight[0, 0] = weight[2, 0] = 1.0
    weight[4, 1] = -1.0
    flat = torch.cat([weight.flatten(), torch.zeros(2), torch.tensor([2.0, -1.0]), torch.tensor([0.5])])
    network = RewardNetwork.from_parameters(ARCHITECTURE, flat[None])
    transitions = Transitions(
        torch.tensor([[1.0, 9.0], [-5.0, 0.0]]),
        torch.tensor([[0.5], [1.0]]),
        torch.tensor([[7.0, -2.0], [0.0, 3.0]]),
        torch.zeros(2),
    )
    # Row 1: h = (1.5, 2): 2 * 1.5 - 2 + 0.5 = 1.5. Row 2: h = (0, 0): 0.5.
    assert network(transitions).tolist() == pytest.approx([15.0, 5.0])


@pytest.mark.parametrize("architecture", [ARCHITECTURE, BOTTLENECK])
def test_a_shared_reward_takes_any_leading_dimensions(architecture) -> None:
    network, transitions = RewardNetwork(architecture, 1, _random()), _transitions(3, 4, 5)
    flat = Transitions(*(part.reshape(60, *part.shape[3:]) for part in transitions))
    assert network(transitions).shape == (3, 4, 5)
    torch.testing.assert_close(network(transitions).flatten(), network(flat))
    one = Transitions(*(part[1, 2, 3] for part in transitions))
    torch.testing.assert_close(network(one), network(transitions)[1, 2, 3])


@pytest.mark.parametrize("architecture", [ARCHITECTURE, BOTTLENECK])
def test_one_reward_per_task_equals_its_members(architecture) -> None:
    network, transitions = RewardNetwork(architecture, 3, _random()), _transitions(3, 7)
    separate = [network.member(t)(Transitions(*(part[t] for part in transitions))) for t in range(3)]
    torch.testing.assert_close(network(transitions), torch.stack(separate))
    assert not torch.allclose(network.parameters[0], network.parameters[1])
    with pytest.raises(ValueError, match="lead with 3"):
        network(_transitions(2, 7))


def test_bottleneck_scores_its_mean_and_trains_on_samples_around_it() -> None:
    network, inputs = RewardNetwork(BOTTLENECK, 1, _random()), torch.randn(1, 5)
    mean = network.output(inputs).value
    assert torch.equal(mean, network.output(inputs).value)
    samples = network.output(inputs.expand(200_000, 5), _random()).value
    assert samples.std() > 0.1
    assert samples.mean().item() == pytest.approx(mean.item(), abs=0.01)
    assert network.output(inputs).information.item() >= 0.0


def test_potential_shapes_the_logit_and_stays_out_of_the_reward() -> None:
    network = RewardNetwork({**ARCHITECTURE, "shaping": True}, 1, _random())
    plain = RewardNetwork.from_parameters(ARCHITECTURE, network.parameters[:, : -(2 * 2 + 2 + 2 + 1)])
    transitions = _transitions(6)
    assert torch.equal(network(transitions), plain(transitions))
    output = network.output(network_inputs(transitions))
    torch.testing.assert_close(network.shaped(output), network(transitions) + output.potential)
    # gamma h(s') - h(s): a step that stays where it is pays -(1 - gamma) h(s), a step back undoes a step forth.
    still = transitions._replace(next_observation=transitions.observation)
    back = transitions._replace(observation=transitions.next_observation, next_observation=transitions.observation)
    h = -network.output(network_inputs(still)).potential / 0.1
    h_next = -network.output(network_inputs(back._replace(next_observation=back.observation))).potential / 0.1
    torch.testing.assert_close(output.potential, 0.9 * h_next - h, rtol=1e-4, atol=1e-5)


def test_unknown_or_incomplete_architecture_is_one_clear_line() -> None:
    with pytest.raises(UserError, match="unknown kind 'tree'"):
        RewardNetwork({**ARCHITECTURE, "kind": "tree"})
    with pytest.raises(UserError, match="lacks 'hidden_sizes'"):
        RewardNetwork({key: value for key, value in ARCHITECTURE.items() if key != "hidden_sizes"})


def _reward(tasks: bool = True) -> LearnedReward:
    return LearnedReward(
        network=RewardNetwork(BOTTLENECK, 1, _random()),
        method="mt_csirl_lt" if tasks else "mt_csirl",
        cs_reward="velocity",
        observation="mapped",
        members=MEMBERS,
        offset=1.5,
        task_network=RewardNetwork(ARCHITECTURE, 2, _random()) if tasks else None,
        task_offsets=(-2.0, 3.0) if tasks else (),
        about={"seed": 100},
    )


@pytest.mark.parametrize("tasks", [False, True])
def test_learned_reward_survives_its_files(tmp_path, tasks) -> None:
    reward, transitions = _reward(tasks), _transitions(4, 3)
    save_learned_reward(reward, tmp_path)
    again = load_learned_reward(tmp_path)
    assert torch.equal(again(transitions), reward(transitions))
    assert torch.equal(again(transitions), reward.network(transitions) - 1.5)
    assert (again.method, again.members, again.about) == (reward.method, MEMBERS, {"seed": 100})
    if tasks:
        task = again.task_reward("drawer-close", 1)
        both = Transitions(*(part[:2] for part in transitions))
        assert torch.equal(task(Transitions(*(part[1] for part in both))), reward.task_network(both)[1] - 3.0)


def test_asking_for_a_task_reward_that_does_not_exist_is_one_clear_line() -> None:
    with pytest.raises(UserError, match="learns no task reward"):
        _reward(tasks=False).task_reward("reach", 1)
    with pytest.raises(UserError, match="no learned task reward for reach-t2; this run has reach-t1, drawer-close-t1"):
        _reward().task_reward("reach", 2)


def test_damaged_rewards_do_not_load(tmp_path) -> None:
    def fresh():
        save_learned_reward(_reward(), tmp_path)
        return tmp_path / "reward.safetensors", tmp_path / "reward.json"

    weights, description = fresh()
    weights.write_bytes(weights.read_bytes()[:100])
    with pytest.raises(UserError, match=r"reward\.safetensors: not a readable safetensors file"):
        load_learned_reward(tmp_path)

    weights, _ = fresh()
    data = bytearray(weights.read_bytes())
    data[-1] ^= 1
    weights.write_bytes(bytes(data))
    with pytest.raises(UserError, match="differs from the checksum"):
        load_learned_reward(tmp_path)

    for change, message in (
        ({"format": "something else"}, "not the description of a learned reward"),
        ({"members": [["reach", 1]]}, "of another run"),
        ({"networks": {"f": ARCHITECTURE, "task": ARCHITECTURE}}, "expected"),
        ({"networks": {}}, "of another run"),
        ({"task_offsets": [0.0]}, "1 task offsets instead of 2"),
    ):
        _, description = fresh()
        description.write_text(json.dumps(json.loads(description.read_text()) | change))
        with pytest.raises(UserError, match=message):
            load_learned_reward(tmp_path)

    description.unlink()
    with pytest.raises(UserError, match="no such file"):
        load_learned_reward(tmp_path)
