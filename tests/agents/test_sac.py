"""The learner: the gradients of its three losses by autograd, several agents at once, acting, state."""

import pytest
import torch
from torch.nn.functional import linear, relu

from mtcsirl.agents.sac import FusedSac
from mtcsirl.settings import SacSettings
from tests.agents.made_up import random_transitions

MINIBATCH = 32


def update(learner, transitions, noise=None):
    observation, action, following, reward = transitions
    learner.update(observation, action, reward, following, noise)


def noise_for(agents, seed=0, dtype=torch.float32):
    generator = torch.Generator().manual_seed(seed)
    return torch.randn(agents, 2, MINIBATCH, 4, generator=generator, dtype=dtype)


def run(stack, index, inputs):
    pairs = list(zip(stack.weights, stack.biases, strict=True))
    for layer, (weight, bias) in enumerate(pairs):
        inputs = linear(inputs, weight[index], bias[index, 0])
        inputs = relu(inputs) if layer < len(pairs) - 1 else inputs
    return inputs


def draw(learner, agent, observation, noise):
    mean, log_std = run(learner.actor, agent, observation).chunk(2, dim=-1)
    log_std = log_std.clamp(-20.0, 2.0)
    action = torch.tanh(mean + log_std.exp() * noise)
    density = torch.distributions.Normal(0.0, 1.0).log_prob(noise) - log_std - torch.log(1 - action**2 + 1e-6)
    return action, density.sum(-1)


@pytest.mark.parametrize("count", [1, 2, 3, 5])
def test_one_update_follows_the_gradients_of_the_losses(count):
    """Haarnoja et al. (2018), equations 5, 7 and 17, differentiated by autograd in float64."""
    settings = SacSettings(
        hidden_sizes=(8, 8),
        critics=count,
        initial_temperature=0.2,
        policy_learning_rate=1e-3,
        critic_learning_rate=2e-3,
        temperature_learning_rate=3e-3,
        discount=0.99,
        polyak=5e-3,
    )
    agents, double = 2, torch.float64
    learner = FusedSac(agents, settings, seeds=[0, 1], dtype=double)
    wrong = FusedSac(agents, settings, seeds=[0, 1], dtype=double)
    batch, noise = random_transitions(agents, MINIBATCH, dtype=double), noise_for(agents, dtype=double)
    observation, action, following, reward = batch

    critics, actor = wrong.critics, wrong.actor
    critics.parameters.requires_grad_()
    critics.weights, critics.biases = critics._views(critics.parameters)
    loss = torch.zeros((), dtype=double)
    for agent in range(agents):
        with torch.no_grad():
            next_action, next_log_prob = draw(wrong, agent, following[agent], noise[agent, 1])
            inputs = torch.cat((following[agent], next_action), -1)
            values = torch.stack([run(wrong.target_critics, c * agents + agent, inputs) for c in range(count)])
            target = reward[agent] + 0.99 * (values.amin(0)[:, 0] - 0.2 * next_log_prob)
        inputs = torch.cat((observation[agent], action[agent]), -1)
        for critic in range(count):
            q_value = run(critics, critic * agents + agent, inputs)[:, 0]
            loss = loss + 0.5 * (q_value - target).square().mean()
    (critic_gradient,) = torch.autograd.grad(loss, critics.parameters)

    update(learner, batch, noise)
    torch.testing.assert_close(learner.critics.gradient, critic_gradient)
    metrics = learner.metrics()
    assert metrics["critic_loss"].sum().item() == pytest.approx(loss.item())

    actor.parameters.requires_grad_()
    actor.weights, actor.biases = actor._views(actor.parameters)
    loss = torch.zeros((), dtype=double)
    for agent in range(agents):
        drawn, log_prob = draw(wrong, agent, observation[agent], noise[agent, 0])
        inputs = torch.cat((observation[agent], drawn), -1)
        values = torch.cat([run(learner.critics, c * agents + agent, inputs) for c in range(count)], -1)
        loss = loss + (0.2 * log_prob - values.amin(-1)).mean()
        expected = 0.2 * torch.exp(-3e-3 * torch.sign(-log_prob.detach().mean() + 4.0))
        assert learner.temperature[agent].item() == pytest.approx(expected.item(), rel=1e-6)
        assert metrics["entropy"][agent].item() == pytest.approx(-log_prob.mean().item())
    (actor_gradient,) = torch.autograd.grad(loss, actor.parameters)
    torch.testing.assert_close(learner.actor.gradient, actor_gradient)
    assert metrics["actor_loss"].sum().item() == pytest.approx(loss.item())
    norms = actor_gradient.norm(dim=1)
    torch.testing.assert_close(metrics["actor_gradient_norm"], norms)


def learned(settings, seeds, minibatch=MINIBATCH, updates=8):
    """Seed -> everything that an agent has learned among others: state, metrics, actions."""
    learner = FusedSac(len(seeds), settings, seeds=seeds)
    batches = [[random_transitions(minibatch, seed=100 * seed + n) for seed in seeds] for n in range(updates)]
    for batch in batches:
        update(learner, [torch.stack(parts) for parts in zip(*batch, strict=True)])
    seen = torch.stack([one.observation[0] for one in batches[0]])
    acted = torch.stack([learner.act(seen) for _ in range(3)])
    metrics = learner.metrics()
    return {
        seed: {name: tensor.clone() for name, tensor in learner.state_dict(agent).items()}
        | {name: values[agent] for name, values in metrics.items()}
        | {"acted": acted[:, agent]}
        for agent, seed in enumerate(seeds)
    }


@pytest.mark.parametrize("hidden_sizes", [(16, 16), (33, 17), (64,), (256, 256)])
@pytest.mark.parametrize("critics", [1, 2, 3, 5])
@pytest.mark.parametrize("minibatch", [64, 50, 7])
def test_agents_in_one_program_have_the_bits_that_they_have_alone(small_sac, hidden_sizes, critics, minibatch):
    settings = small_sac.model_copy(update={"hidden_sizes": hidden_sizes, "critics": critics})
    alone = {seed: learned(settings, [seed], minibatch)[seed] for seed in (5, 6, 7)}
    for seeds in ([5, 6], [7, 5, 6]):
        for seed, found in learned(settings, seeds, minibatch).items():
            different = [name for name, tensor in found.items() if not torch.equal(tensor, alone[seed][name])]
            assert not different, (seed, seeds)


def test_a_fixed_temperature_couples_no_agents_either(small_sac):
    settings = small_sac.model_copy(update={"temperature": 0.7})
    alone, among = learned(settings, [5])[5], learned(settings, [6, 5])[5]
    assert all(torch.equal(tensor, alone[name]) for name, tensor in among.items())
    assert not torch.equal(alone["actor"], learned(settings, [6])[6]["actor"])


def test_initial_weights_depend_on_the_agents_own_seed(small_sac):
    first, second = FusedSac(2, small_sac, seeds=[1, 2]), FusedSac(1, small_sac, seeds=[2])
    assert torch.equal(first.actor.parameters[1], second.actor.parameters[0])
    assert torch.equal(first.critics.parameters[1::2], second.critics.parameters)
    assert not torch.equal(first.actor.parameters[0], first.actor.parameters[1])
    assert torch.equal(first.critics.parameters, first.target_critics.parameters)


def test_fixed_temperature_stays(small_sac):
    learner = FusedSac(1, small_sac.model_copy(update={"temperature": 0.25}), seeds=[0])
    update(learner, random_transitions(1, MINIBATCH))
    assert learner.temperature.item() == pytest.approx(0.25)


def test_acting_follows_the_density_and_the_mode(small_sac):
    learner = FusedSac(1, small_sac, seeds=[0])
    observation = random_transitions(1).observation
    drawn = torch.stack([learner.act(observation) for _ in range(4000)])
    mode = learner.act(observation, deterministic=True)
    assert mode.shape == (1, 4)
    assert torch.equal(mode, learner.act(observation, deterministic=True))
    _, log_std = learner.policy(0).head(observation[0].numpy())
    torch.testing.assert_close(drawn.atanh().mean(0), mode.atanh(), atol=0.08, rtol=0)
    torch.testing.assert_close(drawn.atanh().std(0), torch.from_numpy(log_std)[None].exp(), atol=0, rtol=0.05)
    log_prob = learner.log_prob(observation[:, None].expand(1, 4000, 39), drawn.transpose(0, 1))
    entropy = 0.5 * (1 + torch.log(torch.tensor(2 * torch.pi))) * 4 + log_std.sum()
    squash = torch.log(1 - drawn.square() + 1e-6).sum(-1).mean()
    assert log_prob.mean().item() == pytest.approx(-(entropy + squash).item(), abs=0.1)


def test_policy_acts_as_the_learner(small_sac):
    learner = FusedSac(2, small_sac, seeds=[0, 1])
    observation = random_transitions(2).observation
    mode = learner.act(observation, deterministic=True)
    for agent in range(2):
        policy = learner.policy(agent)
        torch.testing.assert_close(torch.from_numpy(policy.act(observation[agent].numpy())), mode[agent])


def test_restored_learner_goes_on_with_the_same_bytes(small_sac):
    learner = FusedSac(2, small_sac, seeds=[0, 1])
    for step in range(3):
        update(learner, random_transitions(2, MINIBATCH, seed=step))
    restored = FusedSac(2, small_sac, seeds=[0, 1])
    for agent in range(2):
        state = {name: tensor.clone() for name, tensor in learner.state_dict(agent).items()}
        restored.load_state_dict(agent, state)
    for one in (learner, restored):
        update(one, random_transitions(2, MINIBATCH, seed=9))
    for agent in range(2):
        for name, tensor in learner.state_dict(agent).items():
            assert torch.equal(tensor, restored.state_dict(agent)[name]), name
    assert learner.updates == restored.updates == 4
    metrics = restored.metrics()
    assert all(torch.equal(value, metrics[name]) for name, value in learner.metrics().items())


def test_metrics_are_means_since_the_last_reading(small_sac):
    learner = FusedSac(1, small_sac, seeds=[0])
    assert learner.metrics() == {}
    update(learner, random_transitions(1, MINIBATCH))
    first = learner.metrics()
    assert set(first) == {
        "actor_loss",
        "critic_loss",
        "temperature",
        "entropy",
        "actor_gradient_norm",
        "critic_gradient_norm",
    }
    assert learner.metrics() == {}


@pytest.mark.skipif(not torch.cuda.is_available(), reason="needs a CUDA device")
def test_cuda_graph_computes_what_the_cpu_does(small_sac):
    on_cpu, on_cuda = (FusedSac(3, small_sac, seeds=[0, 1, 2], device=device) for device in ("cpu", "cuda"))
    for step in range(10):
        batch, noise = random_transitions(3, MINIBATCH, seed=step), noise_for(3, seed=step)
        update(on_cpu, batch, noise)
        update(on_cuda, [tensor.cuda() for tensor in batch], noise.cuda())
    difference = on_cpu.actor.parameters - on_cuda.actor.parameters.cpu()
    assert difference.norm() <= 1e-3 * on_cpu.actor.parameters.norm()


@pytest.mark.parametrize("count", [1, 3, 5])
def test_the_state_restores_any_number_of_critics(small_sac, count):
    settings = small_sac.model_copy(update={"critics": count})
    learner, restored = (FusedSac(1, settings, seeds=[3]) for _ in range(2))
    for step in range(3):
        update(learner, random_transitions(1, MINIBATCH, seed=step))
    assert learner.state_dict(0)["critics"].shape[0] == count
    restored.load_state_dict(0, {name: tensor.clone() for name, tensor in learner.state_dict(0).items()})
    for one in (learner, restored):
        update(one, random_transitions(1, MINIBATCH, seed=9))
    assert all(torch.equal(tensor, restored.state_dict(0)[name]) for name, tensor in learner.state_dict(0).items())


@pytest.mark.parametrize("name", ["actor", "critics", "target_critics", "metric_sums", "log_temperature"])
def test_what_is_not_finite_is_found_and_its_agent_named(small_sac, name):
    learner = FusedSac(3, small_sac, seeds=[0, 1, 2])
    update(learner, random_transitions(3, MINIBATCH))
    assert learner.broken_agents() == {}
    learner.state_dict(1)[name][0] = float("inf") if name == "actor" else float("nan")
    if name in ("target_critics", "log_temperature"):
        update(learner, random_transitions(3, MINIBATCH))
    assert list(learner.broken_agents()) == [1]
