"""Many small ReLU networks of one shape as one tensor program, with its backward pass written out.

A network computes the same bits alone as among others. Libraries choose a kernel by where a matrix begins in memory and
treat the last numbers of a vector differently, so every network's parameters and every slice of a workspace begin at a
multiple of `ALIGNED` numbers (agents/products.py).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import pairwise

import torch
from torch import Tensor

from mtcsirl.agents.products import affine, aligned, multiply, slices


class Workspace:
    """The memory of one pass through a `NetworkStack` at one minibatch size, reused from update to update.

    activations[l] is the input of layer l, the last one the output; deltas[l] is dL/d activations[l]. All are
    [G, B, size]. What a pass returns stays valid until the next pass through the same workspace.
    """

    def __init__(self, activations: list[Tensor]) -> None:
        self.activations = activations
        self.deltas = [slices(tensor, *tensor.shape) for tensor in activations]

    def first_rows(self, rows: int) -> Workspace:
        """The same pass, for a backward pass through its first rows alone."""
        return Workspace([tensor[:, :rows] for tensor in self.activations])


class NetworkStack:
    """G independent multilayer perceptrons; all their parameters are one tensor.

    Layer l maps x_l to x_{l+1} = relu(x_l W_l^T + b_l), the last one without the ReLU.

    parameters, gradient: [G, P]; `weights[l]` [G, out, in] and `biases[l]` [G, 1, out] are views of them, so an
    optimiser, a copy or an average of all networks is one operation on one tensor. What a row has beyond them is zero.
    """

    def __init__(
        self,
        networks: int,
        sizes: Sequence[int],
        device: torch.device | str = "cpu",
        dtype: torch.dtype = torch.float32,
    ) -> None:
        self.sizes = tuple(sizes)
        count = sum((fan_in + 1) * fan_out for fan_in, fan_out in pairwise(sizes))
        self.parameters = torch.zeros(networks, aligned(count), device=device, dtype=dtype)
        self.gradient = torch.zeros_like(self.parameters)
        self.weights, self.biases = self._views(self.parameters)
        self._transposed = [weight.transpose(1, 2) for weight in self.weights]
        self._weight_gradients, self._bias_gradients = self._views(self.gradient)

    def _views(self, flat: Tensor) -> tuple[list[Tensor], list[Tensor]]:
        weights, biases, start = [], [], 0
        for fan_in, fan_out in pairwise(self.sizes):
            end = start + fan_in * fan_out
            weights.append(flat[:, start:end].view(-1, fan_out, fan_in))
            biases.append(flat[:, end : end + fan_out].view(-1, 1, fan_out))
            start = end + fan_out
        return weights, biases

    def initialise(self, network: int, generator: torch.Generator) -> None:
        """Draw one network as `torch.nn.Linear` does: weights and biases uniform in +-1 / sqrt(fan_in)."""
        for weight, bias in zip(self.weights, self.biases, strict=True):
            bound = weight.shape[2] ** -0.5
            for tensor in (weight[network], bias[network]):
                tensor.copy_(torch.empty(tensor.shape).uniform_(-bound, bound, generator=generator))

    def workspace(self, minibatch: int) -> Workspace:
        """Memory for passes of this many rows per network."""
        return Workspace([slices(self.parameters, len(self.parameters), minibatch, size) for size in self.sizes])

    def forward(self, inputs: Tensor, workspace: Workspace) -> Tensor:
        """inputs [G, B, in] -> outputs [G, B, out]; the workspace keeps every layer for the backward pass."""
        activations = workspace.activations
        if inputs is not activations[0]:
            activations[0].copy_(inputs)
        for layer, (weight, bias) in enumerate(zip(self._transposed, self.biases, strict=True)):
            if layer > 0:
                activations[layer].relu_()
            affine(bias, activations[layer], weight, activations[layer + 1])
        return activations[-1]

    def backward(self, output_gradient: Tensor, workspace: Workspace) -> None:
        """Write dL/dW and dL/db of every layer into `gradient`, given dL/d output [G, B, out]."""
        for layer, delta in self._deltas(output_gradient, workspace):
            multiply(delta.transpose(1, 2), workspace.activations[layer], self._weight_gradients[layer])
            torch.sum(delta, dim=1, keepdim=True, out=self._bias_gradients[layer])

    def input_gradient(self, output_gradient: Tensor, workspace: Workspace, columns: slice) -> Tensor:
        """dL/d inputs[..., columns] [G, B, columns], without any parameter gradient."""
        *_, (_, delta) = self._deltas(output_gradient, workspace)
        # As W^T delta^T: the libraries are several times slower at products with a few columns than with a few rows.
        return torch.bmm(self._transposed[0][:, columns], delta.transpose(1, 2)).transpose(1, 2)

    def _deltas(self, output_gradient: Tensor, workspace: Workspace) -> Iterator[tuple[int, Tensor]]:
        """Back-propagate: yield (layer, dL/d(x_l W_l^T + b_l)) from the last layer to the first."""
        delta = output_gradient
        yield len(self.weights) - 1, delta
        for layer in range(len(self.weights) - 1, 0, -1):
            # The product with a single column is an outer one, which multiplies faster than a matrix product.
            out = workspace.deltas[layer]
            column = delta.shape[-1] == 1
            delta = (
                torch.mul(delta, self.weights[layer], out=out) if column else multiply(delta, self.weights[layer], out)
            )
            relu_backward = torch.ops.aten.threshold_backward.grad_input
            relu_backward(delta, workspace.activations[layer], 0.0, grad_input=delta)
            yield layer - 1, delta
