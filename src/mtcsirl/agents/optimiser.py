"""Adam on one flat tensor."""

from __future__ import annotations

import torch
from torch import Tensor


class FlatAdam:
    """Adam (Kingma and Ba, 2015) with torch's defaults (betas 0.9 and 0.999, epsilon 1e-8), in one fused call.

    The same numbers as `torch.optim.Adam(fused=True)`, without its per-step bookkeeping and the seconds that
    its first use spends on imports. Updates the given tensor in place; captures in a CUDA graph.
    """

    def __init__(self, parameters: Tensor, gradient: Tensor, learning_rate: float) -> None:
        self._parameters, self._gradient = parameters, gradient
        self._learning_rate = learning_rate
        self.mean = torch.zeros_like(parameters)
        self.square = torch.zeros_like(parameters)
        self.steps = torch.zeros((), device=parameters.device, dtype=torch.float32)

    def step(self) -> None:
        """One update from the gradient tensor given at construction."""
        self.steps.add_(1.0)
        torch._fused_adam_(
            [self._parameters],
            [self._gradient],
            [self.mean],
            [self.square],
            [],
            [self.steps],
            lr=self._learning_rate,
            beta1=0.9,
            beta2=0.999,
            weight_decay=0.0,
            eps=1e-8,
            amsgrad=False,
            maximize=False,
        )

    def state(self) -> dict[str, Tensor]:
        """The tensors that a checkpoint needs (not copies)."""
        return {"mean": self.mean, "square": self.square, "steps": self.steps}
