"""The written-out backward pass, and the fused optimiser, against torch's own."""

import pytest
import torch
from torch.nn.functional import linear, relu

from mtcsirl.agents import products
from mtcsirl.agents.networks import NetworkStack
from mtcsirl.agents.optimiser import FlatAdam


@pytest.fixture
def stack() -> NetworkStack:
    stack = NetworkStack(3, (7, 12, 10, 2), dtype=torch.float64)
    for network in range(3):
        stack.initialise(network, torch.Generator().manual_seed(network))
    return stack


@pytest.fixture(params=["numpy", "torch"])
def library(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> str:
    """Either library, whichever processor this is."""
    monkeypatch.setattr(products, "BY_NUMPY", request.param == "numpy")
    return request.param


def plain_forward(stack, network, weights, inputs):
    for layer in range(2):
        inputs = relu(linear(inputs, weights[2 * layer], weights[2 * layer + 1]))
    return linear(inputs, weights[4], weights[5])


def leaves(stack, network):
    pairs = zip(stack.weights, stack.biases, strict=True)
    return [t.clone().requires_grad_() for w, b in pairs for t in (w[network], b[network, 0])]


def test_forward_and_gradients_are_those_of_autograd(stack, library):
    inputs = torch.randn(3, 5, 7, dtype=torch.float64, requires_grad=True)
    output_gradient = torch.randn(3, 5, 2, dtype=torch.float64)
    workspace = stack.workspace(5)
    outputs = stack.forward(inputs.detach(), workspace).clone()
    stack.backward(output_gradient, workspace)
    columns = stack.input_gradient(output_gradient, workspace, slice(4, None))
    for network in range(3):
        weights = leaves(stack, network)
        expected = plain_forward(stack, network, weights, inputs[network])
        torch.testing.assert_close(outputs[network], expected.detach())
        gradients = torch.autograd.grad(expected, [*weights, inputs], output_gradient[network])
        flat = torch.cat([gradient.flatten() for gradient in gradients[:-1]])
        torch.testing.assert_close(stack.gradient[network, : len(flat)], flat)
        assert not stack.gradient[network, len(flat) :].any(), "only there to align"
        torch.testing.assert_close(columns[network], gradients[-1][network, :, 4:])


def test_initial_weights_fill_the_range_of_torch_linear(stack):
    for weight in (*stack.weights, *stack.biases):
        assert weight.abs().max() > 0
    bound = 12**-0.5
    assert 0.8 * bound < stack.weights[1].abs().max() <= bound
    assert stack.biases[1].abs().max() <= bound
    assert not torch.equal(stack.parameters[0], stack.parameters[1])


def test_flat_adam_is_adam():
    generator = torch.Generator().manual_seed(0)
    ours = torch.randn(2, 50, generator=generator)
    theirs = ours.clone().requires_grad_()
    gradient = torch.zeros_like(ours)
    optimiser, reference = FlatAdam(ours, gradient, 1e-2), torch.optim.Adam([theirs], lr=1e-2)
    for _ in range(20):
        gradient.copy_(torch.randn(2, 50, generator=generator))
        theirs.grad = gradient.clone()
        optimiser.step()
        reference.step()
    torch.testing.assert_close(ours, theirs.detach(), rtol=1e-6, atol=1e-7)


@pytest.mark.parametrize("sizes", [(43, 256, 256, 1), (39, 256, 256, 8), (5, 3, 1)])
def test_a_network_has_the_same_bits_alone_and_among_others(library, sizes):
    """Outputs, gradients of parameters and of inputs; and both libraries round no worse than float32 has to."""
    rows, places = 64, slice(sizes[0] - 2, None)
    made = {}
    for networks in ((0, 1, 2), (1,), (2,)):
        stack = NetworkStack(len(networks), sizes)
        exact = NetworkStack(len(networks), sizes, dtype=torch.float64)
        inputs, outer = (torch.empty(len(networks), rows, size) for size in (sizes[0], sizes[-1]))
        for place, network in enumerate(networks):
            generator = torch.Generator().manual_seed(network)
            stack.initialise(place, generator)
            inputs[place].normal_(generator=generator)
            outer[place].normal_(generator=generator)
        exact.parameters.copy_(stack.parameters)
        found, right = (
            passes(one, inputs.to(one.parameters), outer.to(one.parameters), places) for one in (stack, exact)
        )
        for ours, theirs in zip(found, right, strict=True):
            assert (ours - theirs).norm() <= 1e-6 * theirs.norm()
        made |= {(len(networks), network): [part[place] for part in found] for place, network in enumerate(networks)}
    for network in (1, 2):
        assert all(torch.equal(*pair) for pair in zip(made[1, network], made[3, network], strict=True))


def passes(stack, inputs, outer, places):
    workspace = stack.workspace(inputs.shape[1])
    outputs = stack.forward(inputs, workspace).clone()
    stack.backward(outer, workspace)
    return outputs, stack.gradient.clone(), stack.input_gradient(outer, workspace, places).clone()


def test_the_library_follows_the_maker_of_the_processor():
    assert products.by_numpy("vendor_id\t: AuthenticAMD\nflags\t: avx2")
    assert not products.by_numpy("vendor_id\t: GenuineIntel\nflags\t: avx2 avx512f")
    assert not products.by_numpy("")
