"""Random transitions for the tests of the agents."""

import torch

from mtcsirl.transitions import Transitions


def random_transitions(*shape: int, seed: int = 0, dtype: torch.dtype = torch.float32) -> Transitions:
    generator = torch.Generator().manual_seed(seed)

    def normal(*sizes: int) -> torch.Tensor:
        return torch.randn(*shape, *sizes, generator=generator, dtype=dtype)

    return Transitions(normal(39), torch.tanh(normal(4)), normal(39), 5.0 + normal())
