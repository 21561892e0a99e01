import numpy as np
import pytest

from mtcsirl.names import CS_REWARDS, METHODS, SINGLE_TASKS, TRAIN_TASKS
from mtcsirl.results.published import load_published
from mtcsirl.results.statistics import prediction_interval
from mtcsirl.rewards.ground_truth import COMMON_SENSE_REWARDS

PAPER = load_published()


def test_numbers_of_the_paper_in_our_units():
    assert PAPER.unseen("mt_csirl", "action_norm", "action_norm") == (2.75, 0.18, 5)
    assert PAPER.unseen("mt_csirl", "action_norm", "success") == pytest.approx((0.999, 1e-4, 5))
    assert PAPER.cross_transfer("velocity", "drawer-close", "button-press-topdown-wall").mean == 0.48
    assert PAPER.cross_baseline("action_norm", "coffee-button").mean == 0.48
    assert PAPER.learned_task("reach", "velocity", "velocity").mean == 0.89
    assert PAPER.learned_task("reach", "velocity", "success") == pytest.approx((0.842, 0.0214, 5))
    assert PAPER.correlation("single_target", "velocity").mean == 0.18


def test_the_ground_truth_aims_at_what_the_paper_states():
    """Section 5: C_v = 0.8, C_n = 3, read as targets; Table 2's experts reach them within 2 %."""
    targets = {name: COMMON_SENSE_REWARDS[name].target for name in CS_REWARDS}
    assert targets == {"velocity": 0.8, "action_norm": 3.0}
    for name, target in targets.items():
        assert PAPER.unseen("expert", name, name).mean == pytest.approx(target, rel=0.02)


@pytest.mark.parametrize("cs_reward", CS_REWARDS)
def test_covers_every_cell_of_the_design(cs_reward):
    for agent in ("expert", "sac", *METHODS):
        for metric in (cs_reward, "success"):
            assert np.isfinite(PAPER.unseen(agent, cs_reward, metric)).all()
    for source in SINGLE_TASKS:
        assert all(np.isfinite(PAPER.cross_transfer(cs_reward, source, task).mean) for task in SINGLE_TASKS)
    assert all(np.isfinite(PAPER.learned_task(task, cs_reward, cs_reward).mean) for task in TRAIN_TASKS)


def test_what_the_paper_does_not_print_is_unknown():
    cell = PAPER.cross_transfer("velocity", "reach-wall", "push-back")
    assert np.isnan(cell.std)
    assert np.isnan(prediction_interval(cell, 5).low)
    unknown = [
        PAPER.unseen("own_method", "velocity", "velocity"),
        PAPER.unseen("mt_csirl", "energy", "energy"),
        PAPER.cross_transfer("energy", "reach-wall", "reach-wall"),
        PAPER.cross_transfer("velocity", "reach-wall", "hammer"),
        PAPER.cross_baseline("velocity", "hammer"),
        PAPER.learned_task("hammer", "velocity", "velocity"),
        PAPER.correlation("single_target", "action_norm"),
    ]
    assert all(np.isnan(number.mean) and number.n == 0 for number in unknown)
