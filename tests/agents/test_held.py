"""Held random actions: whole blocks, the asked share of them, none after the end, alone with one's seed."""

import numpy as np
import pytest

from mtcsirl.agents.held import HeldExplorers
from mtcsirl.settings.loading import load
from mtcsirl.settings.runs import expert_run

STEPS = 4_000


def _explorers(seeds: list[int], share: float = 0.25) -> HeldExplorers:
    return HeldExplorers(seeds, [share] * len(seeds), length=8, until=2_000)


def _actions(seeds: list[int], share: float = 0.25) -> np.ndarray:
    """What becomes of actions that are all 9 [step, agent, 4]."""
    explorers, taken = _explorers(seeds, share), np.full((STEPS, len(seeds), 4), 9.0, dtype=np.float32)
    for step, action in enumerate(taken):
        explorers.replace(action, step)
    return taken


def test_a_share_of_all_blocks_holds_one_random_action():
    taken = _actions([3])[:2_000, 0].reshape(-1, 8, 4)
    assert (taken == taken[:, :1]).all(), "one action a block"
    held = taken[(taken != 9.0).all(axis=(1, 2)), 0]
    assert len(held) == pytest.approx(0.25 * len(taken), rel=0.3)
    assert np.abs(held).max() <= 1.0
    assert held.std() == pytest.approx(np.sqrt(1 / 3), rel=0.15), "uniform"


def test_none_after_the_end_and_none_without_a_share():
    assert (_actions([3])[2_000:] == 9.0).all()
    assert (_actions([3], share=0.0) == 9.0).all()


def test_neighbours_and_the_step_it_begins_with_change_nothing():
    alone, together = _actions([3]), _actions([5, 3])
    assert (alone[:, 0] == together[:, 1]).all()
    assert (together[:, 0] != together[:, 1]).any()
    action = np.full((1, 4), 9.0, dtype=np.float32)
    resumed = _explorers([3])
    for step in range(1_003, 1_200):
        action[:] = 9.0
        resumed.replace(action, step)
        assert (action[0] == alone[step, 0]).all()


def test_experts_hold_until_a_share_of_their_budget():
    settings = load(
        overrides=[
            "expert.held_share={velocity: {default: 0.1}, action_norm: {default: 0.0, reach: 0.2}}",
            "expert.held_until=0.5",
        ]
    )
    own = expert_run(settings, "window-open", "velocity")
    assert (own.held_share, own.held_until) == (0.1, 0.5)
    assert expert_run(settings, "push-back", "action_norm").held_share == 0.0
    assert expert_run(settings, "reach", "action_norm").held_share == 0.2
