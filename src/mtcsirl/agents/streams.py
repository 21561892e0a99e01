"""Random numbers that each agent draws from streams of its own seed, so that its neighbours are invisible to it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from enum import IntEnum
from math import prod

import numpy as np
import torch
from torch import Tensor

_BLOCK = 32_768
"""Numbers of an agent drawn at a time: a call of the generator costs as much as a thousand numbers."""


class Purpose(IntEnum):
    """What an agent draws random numbers for; each has a stream of its own."""

    UPDATES = 11
    """The policy's noise in gradient steps, in s and in s'."""
    ACTIONS = 12
    """The policy's noise in the environment."""
    RANDOM_ACTIONS = 13
    """Uniform actions before the policy acts."""
    MINIBATCHES = 14
    """Which transitions a gradient step sees."""
    TRIALS = 15
    """Episodes that select a policy."""


def normal(out: Tensor, generator: torch.Generator) -> None:
    """Fill with draws from N(0, 1)."""
    torch.randn(out.shape, generator=generator, out=out)


def uniform(out: Tensor, generator: torch.Generator) -> None:
    """Fill with draws from U(0, 1)."""
    torch.rand(out.shape, generator=generator, out=out)


class Streams:
    """Draw k of agent i: a tensor of one shape that depends on seeds[i], purpose, shape and k, and on nothing else.

    So there is no state to save but the number of the next draw, which the caller counts. Draws are made in blocks; the
    generator of a block is seeded with (seed, purpose, block).
    """

    def __init__(
        self,
        seeds: Sequence[int],
        purpose: Purpose,
        shape: Sequence[int],
        fill: Callable[[Tensor, torch.Generator], None] = normal,
        device: torch.device | str = "cpu",
        dtype: torch.dtype = torch.float32,
    ) -> None:
        self._seeds, self._purpose, self._fill = tuple(seeds), purpose, fill
        self._draws = max(1, _BLOCK // prod(shape))
        self._generator = torch.Generator(device)
        self._block, self._rows = -1, torch.empty(0)
        self._shape = (len(self._seeds), self._draws, *shape)
        self._device, self._dtype = device, dtype

    def draw(self, number: int) -> Tensor:
        """Draw ``number`` of every agent [A, *shape]; valid until the next draw of another block."""
        block, row = divmod(number, self._draws)
        if block != self._block:
            self._make(block)
        return self._rows[:, row]

    def _make(self, block: int) -> None:
        if self._block < 0:
            self._rows = torch.empty(self._shape, device=self._device, dtype=self._dtype)
        for own, seed in zip(self._rows, self._seeds, strict=True):
            self._generator.manual_seed(derived_seed(seed, self._purpose, block))
            self._fill(own, self._generator)
        self._block = block


def derived_seed(*entropy: int) -> int:
    """A seed in [0, 2^63) made of several numbers."""
    return int(np.random.SeedSequence(entropy).generate_state(1, np.uint64)[0] >> np.uint64(1))
