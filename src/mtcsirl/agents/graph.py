"""CUDA graphs: launch a whole gradient step as one operation."""

from __future__ import annotations

from collections.abc import Callable

import torch
from torch import Tensor

_EAGER_CALLS = 3


class CudaGraph:
    """Calls `program(*tensors)`, which must change tensors in place, return nothing and never wait for the device.

    The first three calls run eagerly on a side stream, as capturing needs; then the program is captured once and
    replayed. One set of shapes only: make one graph per minibatch size.
    """

    def __init__(self, program: Callable[..., None]) -> None:
        self._program = program
        self._calls = 0
        self._inputs: list[Tensor] = []
        self._graph: torch.cuda.CUDAGraph | None = None

    def __call__(self, *tensors: Tensor) -> None:
        """Run the program on these tensors."""
        if self._calls < _EAGER_CALLS:
            self._calls += 1
            self._eager(tensors)
            return
        if self._graph is None:
            self._inputs = [tensor.clone() for tensor in tensors]
            self._graph = torch.cuda.CUDAGraph()
            with torch.cuda.graph(self._graph):
                self._program(*self._inputs)
        for static, tensor in zip(self._inputs, tensors, strict=True):
            static.copy_(tensor)
        self._graph.replay()

    def _eager(self, tensors: tuple[Tensor, ...]) -> None:
        side = torch.cuda.Stream()
        side.wait_stream(torch.cuda.current_stream())
        with torch.cuda.stream(side):
            self._program(*tensors)
        torch.cuda.current_stream().wait_stream(side)
