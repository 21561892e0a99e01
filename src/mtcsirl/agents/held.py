"""Random actions held for a while, as explorers: temporally extended epsilon-greedy (Dabney et al., 2021).

The hand follows a point that actions move and that runs ahead of a hand pressed against something. There, changing
single actions changes no speed, and an agent that does its task slowly has no gradient towards doing it fast.
"""

from collections.abc import Sequence

import numpy as np

_STREAM = 1_000_003
"""Keeps these random numbers apart from others drawn with the same seed and step."""


class HeldExplorers:
    """In a share of all blocks of steps, agent i holds one a ~ U(-1, 1)^4 for the whole block.

    Blocks and actions depend on seed and step alone: nothing to save, and what agents in lockstep do leaves each
    other's alone.
    """

    def __init__(self, seeds: Sequence[int], shares: Sequence[float], length: int, until: int) -> None:
        """``shares``: which share of the blocks of ``length`` steps that begin before step ``until``, by agent."""
        agents = enumerate(zip(seeds, shares, strict=True))
        self._agents = [(index, seed, share) for index, (seed, share) in agents if share > 0]
        self._length, self._until = length, until
        self._block = -1
        self._held: dict[int, np.ndarray] = {}

    def replace(self, action: np.ndarray, step: int) -> None:
        """Overwrite the rows of ``action`` [A, 4] of agents that hold a random action in this step."""
        block = step // self._length
        if block != self._block:
            self._block, self._held = block, self._draw(block, action.shape[-1])
        for index, held in self._held.items():
            action[index] = held

    def _draw(self, block: int, size: int) -> dict[int, np.ndarray]:
        held: dict[int, np.ndarray] = {}
        if block * self._length < self._until:
            for index, seed, share in self._agents:
                stream = np.random.default_rng((seed, _STREAM, block))
                if stream.random() < share:
                    held[index] = stream.uniform(-1.0, 1.0, size)
        return held
