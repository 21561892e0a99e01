"""Many small ReLU networks of one shape as one tensor program, with its backward pass written out."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import torch
from torch import Tensor

Activations = list[Tensor]
"""What `forward` computed: the inputs, every hidden layer after its ReLU, and the outputs."""


class NetworkStack:
    """G independent multilayer perceptrons; all their parameters are one tensor.

    Layer l maps x_l to x_{l+1} = relu(x_l W_l + b_l), the last one without the ReLU.

    parameters, gradient: [G, P]; `weights[l]` [G, in, out] and `biases[l]` [G, 1, out] are views of them, so an
    optimiser, a copy or an average of all networks is one operation on one tensor.
    """

    def __init__(
        self,
        networks: int,
        sizes: Sequence[int],
        device: torch.device | str = "cpu",
        dtype: torch.dtype = torch.float32,
    ) -> None:
        self.sizes = tuple(sizes)
        count = sum((fan_in + 1) * fan_out for fan_in, fan_out in zip(sizes, sizes[1:], strict=False))
        self.parameters = torch.zeros(networks, count, device=device, dtype=dtype)
        self.gradient = torch.zeros_like(self.parameters)
        self.weights, self.biases = self._views(self.parameters)
        self._weight_gradients, self._bias_gradients = self._views(self.gradient)

    def _views(self, flat: Tensor) -> tuple[list[Tensor], list[Tensor]]:
        weights, biases, start = [], [], 0
        for fan_in, fan_out in zip(self.sizes, self.sizes[1:], strict=False):
            end = start + fan_in * fan_out
            weights.append(flat[:, start:end].view(-1, fan_in, fan_out))
            biases.append(flat[:, end : end + fan_out].view(-1, 1, fan_out))
            start = end + fan_out
        return weights, biases

    def initialise(self, network: int, generator: torch.Generator) -> None:
        """Draw one network as `torch.nn.Linear` does: weights and biases uniform in +-1 / sqrt(fan_in)."""
        for weight, bias in zip(self.weights, self.biases, strict=True):
            bound = weight.shape[1] ** -0.5
            for tensor in (weight[network], bias[network]):
                drawn = torch.empty(tensor.shape).uniform_(-bound, bound, generator=generator)
                tensor.copy_(drawn)

    def forward(self, inputs: Tensor) -> Activations:
        """inputs [G, B, in] -> activations of every layer; the last is the output [G, B, out]."""
        activations = [inputs]
        for weight, bias in zip(self.weights, self.biases, strict=True):
            outputs = torch.baddbmm(bias, activations[-1], weight)
            activations.append(outputs if weight is self.weights[-1] else outputs.relu_())
        return activations

    def backward(self, activations: Activations, output_gradient: Tensor) -> None:
        """Write dL/dW and dL/db of every layer into `gradient`, given dL/d output [G, B, out]."""
        for layer, delta in self._deltas(activations, output_gradient):
            torch.bmm(activations[layer].transpose(1, 2), delta, out=self._weight_gradients[layer])
            torch.sum(delta, dim=1, keepdim=True, out=self._bias_gradients[layer])

    def input_gradient(self, activations: Activations, output_gradient: Tensor, columns: slice) -> Tensor:
        """dL/d inputs[..., columns] [G, B, columns], without any parameter gradient."""
        *_, (_, delta) = self._deltas(activations, output_gradient)
        return torch.bmm(delta, self.weights[0][:, columns].transpose(1, 2))

    def _deltas(self, activations: Activations, output_gradient: Tensor) -> Iterator[tuple[int, Tensor]]:
        """Back-propagate: yield (layer, dL/d(x_l W_l + b_l)) from the last layer to the first."""
        delta = output_gradient
        yield len(self.weights) - 1, delta
        for layer in range(len(self.weights) - 1, 0, -1):
            delta = torch.bmm(delta, self.weights[layer].transpose(1, 2))
            relu_backward = torch.ops.aten.threshold_backward.grad_input
            relu_backward(delta, activations[layer], 0.0, grad_input=delta)
            yield layer - 1, delta
