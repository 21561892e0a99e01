"""What is missing decides nothing: studies of which a part is there, and tasks on which nothing can be seen."""

import numpy as np
import pytest

from mtcsirl.claims.judging import FARTHER, LIKE_SAC, NO_GAP, NOT_RUN, TRANSFERS, at_least
from tests.claims.made_up import (
    SETTINGS,
    as_the_paper_says,
    at,
    changed,
    fail_gates,
    finding,
    missing,
    off_diagonal,
    points,
    replicated,
    transfer,
)

EXPERTS = ["train_expert", "collect_demonstrations"]
NEAR = {"velocity": 0.74, "action_norm": 2.76}
"""Plain SAC within 8 % of either target."""


def first_seeds(count, **failed):
    """Only so many seeds of everything, of which some fail their gate."""

    def change(rows):
        rows = missing(replicated(rows), seed=list(SETTINGS.seeds[count:]))
        return fail_gates(rows, **failed) if failed else rows

    return change


@pytest.mark.parametrize(("name", "experts"), [("C2", 5), ("C3", 5), ("C7", 30)])
def test_failed_experts_of_the_one_seed_that_is_there_let_the_other_four_pass(name, experts):
    found = finding(name, change=first_seeds(1, stage="train_expert", seed=0))
    assert found.verdict == "not run"
    why = f"0 of {experts} experts passed their gate, {experts * 4 // 5} missing"
    assert all(unit.reason == why for unit in found.units if unit.state == NOT_RUN)


@pytest.mark.parametrize("name", ["C2", "C3"])
def test_two_failed_experts_of_two_that_are_there_cannot_be_made_good(name):
    found = finding(name, change=first_seeds(2, stage="train_expert", seed=[0, 1]))
    assert found.verdict == "precondition not met"


@pytest.mark.parametrize("name", ["C3", "C7", "C9"])
def test_a_reward_whose_experts_nobody_saw_shows_nothing(name):
    found = finding(name, change=lambda rows: missing(rows, stage=EXPERTS))
    assert found.verdict == "not run"
    assert any("missing" in unit.reason for unit in found.units)


def test_one_seed_of_sac_near_the_target_does_not_close_the_gap():
    def near(agent):
        return NEAR if agent["stage"] == "train_sac" else as_the_paper_says(agent)

    few = finding("C7", near, change=lambda rows: missing(rows, stage="train_sac", seed=[1, 2, 3, 4]))
    assert {unit.state for unit in few.units} == {"too few seeds", "not judged"}
    assert finding("C7", near).verdict == "precondition not met"


def test_pairs_are_counted_and_not_the_seeds_of_either_side():
    """Ten seeds, eight of either side, six of which are pairs; then four, which are too few."""
    ten = SETTINGS.model_copy(update={"seeds": tuple(range(10)), "irl_seeds": tuple(range(10))})

    def without(count):
        def change(rows):
            rows = missing(rows, stage="transfer", experiment="multi_task", method="mt_csirl", seed=list(range(count)))
            last = list(range(10 - count, 10))
            return missing(rows, stage="transfer", experiment="multi_target", source="coffee-button", seed=last)

        return change

    assert finding("C13", settings=ten, change=without(2)).verdict == "reproduced"
    found = finding("C13", settings=ten, change=without(3))
    assert found.verdict == "inconclusive"
    assert found.units[0].reason == "4 of the 5 independent seeds a verdict needs"


def test_nothing_is_said_of_agents_that_are_not_judged():
    all_transfer = changed(lambda agent: transfer(agent, "single_target"), lambda agent: at(agent["cs_reward"], 0.8))
    for change in (first_seeds(2), lambda rows: fail_gates(rows, stage="learn_reward")):
        assert {unit.outcome for unit in finding("C3", all_transfer, change=change).units} == {""}


@pytest.mark.parametrize("there", [{"velocity": 0.78, "action_norm": 2.94}, NEAR])
def test_a_task_without_a_gap_decides_nothing_of_c6(there):
    """On push-back SAC is on target by itself: agents there are no proof of transfer, nor of its lack."""

    def means(agent):
        if agent["task"] == "push-back" and agent["stage"] == "train_sac":
            return NEAR
        return there if agent["task"] == "push-back" and off_diagonal(agent) else as_the_paper_says(agent)

    found = finding("C6", means, spread=0.005)
    others = [unit for unit in found.units if unit.what != "push-back"]
    assert {unit.state for unit in others} == {"unclear"}
    assert all(unit.outcome == f"3 {LIKE_SAC}, 1 {NO_GAP}" for unit in others)


@pytest.mark.parametrize(("part", "outcome"), [(0.9, TRANSFERS), (3.0, FARTHER), (-0.6, FARTHER)])
def test_an_agent_far_beyond_the_target_has_not_the_behaviour(part, outcome):
    alone = changed(lambda agent: transfer(agent, "single_target"), lambda agent: at(agent["cs_reward"], part))
    assert {unit.outcome for unit in finding("C3", alone).units} == {outcome}
    elsewhere = changed(off_diagonal, lambda agent: at(agent["cs_reward"], part))
    assert {unit.outcome for unit in finding("C6", elsewhere).units} == {outcome}


@pytest.mark.parametrize("sign", [-1, 1])
def test_a_reward_that_is_the_task_reward_with_either_sign_leaves_c4_open(sign):
    def make(key, partial, generator, count):
        t, u, v = generator.normal(size=(3, count))
        return sign * t + 0.1 * v, -0.77 * t + np.sqrt(1 - 0.77**2) * u, t

    assert finding("C4", transitions=points(make=make)).verdict == "inconclusive"


def successes(values):
    """The group of new agents with these shares of ten episodes, one a seed."""
    import pandas as pd

    from mtcsirl.claims.groups import Group

    frame = pd.DataFrame({"velocity": 0.8, "success": values})
    return Group("transfer", "new agents", {"reach": frame}, "velocity", 0.8, episodes=10)


@pytest.mark.parametrize(
    ("values", "answer"),
    [
        ([1.0] * 5, "met"),
        ([1.0, 1.0, 1.0, 1.0, 0.9], "met"),
        ([1.0, 1.0, 0.9, 0.9, 0.9], "unclear"),
        ([1.0, 0.9, 0.9, 0.9, 0.9], "unclear"),
        ([0.9] * 5, "unclear"),
        ([0.8] * 5, "unclear"),
        ([1.0, 0.8, 0.8, 0.8, 0.8], "unclear"),
        ([0.7] * 5, "not met"),
        ([0.8, 0.7, 0.7, 0.7, 0.7], "not met"),
        ([0.0] * 5, "not met"),
    ],
)
def test_seeds_that_agree_by_chance_are_no_surer_of_their_success(values, answer):
    assert at_least(successes(values).sure_success, 0.9, "success")[0] == answer


def test_the_worst_of_a_success_falls_as_episodes_are_lost():
    """Whichever seeds lose them: of two groups the one with fewer successes is never judged better."""
    order = {"not met": 0, "unclear": 1, "met": 2}
    spread_out = [np.clip(1.0 - (np.arange(5) < lost % 5) * 0.1 - lost // 5 * 0.1, 0, 1) for lost in range(26)]
    answers = [order[at_least(successes(values).sure_success, 0.9, "")[0]] for values in spread_out]
    assert answers == sorted(answers, reverse=True)


def test_not_run_is_no_verdict_on_units_that_are_there():
    found = finding("C2", change=first_seeds(1, stage="train_expert", seed=0))
    assert {unit.state for unit in found.units} == {NOT_RUN}
