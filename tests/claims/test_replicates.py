"""What counts as a replicate: agents that share a reward are one, and experts are those that a reward came from."""

import numpy as np
import pandas as pd
import pytest

from mtcsirl.claims.groups import Group
from mtcsirl.results.notes import study_note
from tests.claims.made_up import (
    SAC,
    SETTINGS,
    TARGETS,
    as_the_paper_says,
    at,
    changed,
    fail_gates,
    finding,
    missing,
    points,
    rewards,
    transfer,
    useless,
)

VELOCITY = SETTINGS.model_copy(update={"cs_rewards": ("velocity",)})
CLOSED = (0.25, 0.55, 0.75, 0.95, 1.0)
"""Part of SAC's gap that agents on each of five learned rewards close: 0.70 in the mean, 0.32 to 1.08 at 95 %."""


def of_unequal_rewards(rows):
    own = (rows["stage"] == "transfer") & (rows["method"] == "mt_csirl") & (rows["metric"] == "velocity")
    parts = (rows["seed"] % len(CLOSED)).map(dict(enumerate(CLOSED)))
    return rows.assign(value=rows["value"].mask(own, SAC["velocity"] + parts * (TARGETS["velocity"] - SAC["velocity"])))


def test_more_agents_on_the_same_rewards_are_no_more_evidence_on_rewards():
    """Ten agents on five rewards say of rewards what five say; ten on ten rewards say more."""
    few = finding("C7", settings=VELOCITY, change=of_unequal_rewards)
    ten = {"seeds": tuple(range(10))}
    many = finding("C7", settings=VELOCITY.model_copy(update=ten), change=of_unequal_rewards)
    own = finding(
        "C7", settings=VELOCITY.model_copy(update=ten | {"irl_seeds": ten["seeds"]}), change=of_unequal_rewards
    )
    assert (few.verdict, many.verdict, own.verdict) == ("inconclusive", "inconclusive", "reproduced")
    assert [found.units[1].ours.n for found in (few, many, own)] == [5, 5, 10]
    assert many.units[1].value.value == pytest.approx(few.units[1].value.value, abs=0.01)


def test_a_table_says_that_agents_share_rewards():
    ten = VELOCITY.model_copy(update={"seeds": tuple(range(10))})
    assert study_note(ten).text.endswith("new agents share the rewards of 5 IRL seeds: intervals are too short")
    assert "share" not in study_note(VELOCITY).text


def two_on_one_reward(*values):
    frame = pd.DataFrame({"velocity": values, "success": 1.0, "folder": "f"}, index=range(len(values)))
    return Group("transfer", "new agents", {"reach": frame}, "velocity", 0.8, 10, shared={0: 0, 1: 0, 2: 1, 3: 1})


def test_agents_on_both_sides_of_the_target_are_not_on_it():
    group = two_on_one_reward(0.6, 1.0, 0.8, 0.8)
    assert list(group.distances["reach"]) == pytest.approx([0.2, 0.0])
    assert list(group.values("velocity")["reach"]) == pytest.approx([0.8, 0.8])
    assert group.metric.n == 2


def test_a_reward_that_lacks_one_of_its_agents_has_no_mean():
    assert two_on_one_reward(0.6, np.nan, 0.8, 0.8).metric.n == 1


OWN = {"seeds": (10, 11, 12, 13, 14)}
WITH_OWN_SEEDS = VELOCITY.model_copy(update={"ablations": SETTINGS.ablations.model_copy(update=OWN)})


@pytest.mark.parametrize(("seeds", "verdict"), [(OWN["seeds"], "precondition not met"), (range(5), "reproduced")])
def test_an_ablation_needs_the_experts_that_its_generators_imitate(seeds, verdict):
    own = {"stage": ["train_expert", "collect_demonstrations"], "seed": list(seeds)}
    found = finding("C12", settings=WITH_OWN_SEEDS, change=lambda rows: fail_gates(rows, **own))
    assert found.verdict == verdict


def test_an_ablation_has_as_many_irl_seeds_as_it_trains():
    assert finding("C12", settings=WITH_OWN_SEEDS.model_copy(update={"irl_seeds": (0,)})).verdict == "reproduced"


# --- evaluations that say nothing ------------------------------------------------------------------------------------


@pytest.mark.parametrize("status", ["incomplete", "duplicated", "foreign"])
def test_an_evaluation_that_says_nothing_is_no_failed_gate(status):
    """It may pass once it is whole, as a missing one may; one that failed does not."""
    found = finding("C3", change=lambda rows: useless(rows, status, stage="train_sac", seed=[1, 2]))
    assert {unit.state for unit in found.units} == {"too few seeds"}
    failed = finding("C3", change=lambda rows: fail_gates(rows, stage="train_sac", seed=[1, 2]))
    assert {unit.reason for unit in failed.units} == {"2 of 5 SAC agents failed their gate"}


def test_a_precondition_counts_what_is_missing_and_what_says_nothing():
    def change(rows):
        rows = useless(rows, "duplicated", stage="train_expert", task="reach-wall", seed=[2, 3])
        return missing(rows, stage="train_expert", task="reach-wall", seed=4)

    found = finding("C3", settings=VELOCITY, change=change)
    (unit,) = (unit for unit in found.units if unit.what == "reach-wall")
    said = "2 of 5 experts passed their gate, 1 missing, 2 without an evaluation that counts"
    assert (unit.state, unit.reason) == ("not run", said)


def test_what_is_not_there_is_named():
    found = finding("C7", settings=VELOCITY, change=lambda rows: missing(rows, stage="train_sac"))
    assert found.units[1].reason == "of plain SAC none has been trained for this, or none is usable"
    off = {"stage": "transfer", "experiment": "multi_target", "source": "coffee-button"}
    found = finding("C13", settings=VELOCITY, change=lambda rows: missing(rows, **off))
    assert "of new agents on coffee-button's reward none" in found.units[0].reason


# --- numbers at the edge ---------------------------------------------------------------------------------------------


@pytest.mark.parametrize("velocity", [0.6, 1.0])
def test_on_the_limit_is_within_it(velocity):
    def generators(value):
        return changed(lambda a: a["stage"] == "learn_reward", lambda a: {**SAC, "velocity": value, "success": 1.0})

    beyond = velocity + np.sign(velocity - 0.8) * 0.001
    assert finding("C2", generators(velocity), settings=VELOCITY, spread=0).verdict == "reproduced"
    assert finding("C2", generators(beyond), settings=VELOCITY, spread=0).verdict == "not reproduced"


def test_a_spread_whose_square_is_no_number_is_none():
    def creep(rows):
        still = (rows["metric"] == "velocity") & (rows["stage"] == "train_sac")
        slow = (rows["metric"] == "velocity") & (rows["experiment"] == "single_target") & (rows["stage"] == "transfer")
        rows = rows.assign(value=rows["value"].mask(still, 0.0))
        return rows.assign(value=rows["value"].mask(slow, (rows["seed"] + 1) * 1e-90))

    assert finding("C3", settings=VELOCITY, change=creep).verdict == "reproduced"


def test_one_seed_has_no_interval_and_none_is_printed():
    one = finding("C7", settings=VELOCITY, change=lambda rows: missing(rows, stage="transfer", seed=[1, 2, 3, 4]))
    assert not [note for unit in one.units for note in unit.notes if "nan" in note]
    better = changed(lambda a: transfer(a, "multi_task"), lambda a: at(a["cs_reward"], 1.0))
    (note,) = (n for n in finding("C7", better, settings=VELOCITY).units[0].notes if "ground truth" in n)
    assert "d less the experts' is -0.0" in note


def in_seed(seed, change):
    """The usual points, in which the rewards of one IRL seed are others."""

    def make(key, partial, generator, count):
        made = rewards(key, partial, generator, count)
        return change(*made) if key["seed"] == seed else made

    return points(make=make, settings=VELOCITY)


def test_the_seed_that_says_nothing_is_named():
    flat = in_seed(3, lambda f, c, t: (0 * f, c, t))
    found = finding("C9", settings=VELOCITY, transitions=flat)
    assert {unit.reason for unit in found.units} == {"IRL seed 3: the learned or the true reward does not vary"}
    spent = in_seed(3, lambda f, c, t: (-t, c, t))
    for unit in finding("C9", settings=VELOCITY, transitions=spent).units:
        assert unit.reason.startswith("IRL seed 3: r = 0.")
        assert unit.reason.endswith("says nothing beyond r_task: the learned or the true reward is a function of it")
    every = points(make=lambda *made: (lambda f, c, t: (0 * f, c, t))(*rewards(*made)), settings=VELOCITY)
    assert {unit.reason for unit in finding("C9", settings=VELOCITY, transitions=every).units} == {
        "the learned or the true reward does not vary"
    }


@pytest.mark.parametrize("scale", [1e-13, 1.0, 1e20])
def test_the_unit_of_a_reward_decides_nothing(scale):
    small = points(make=lambda *made: (lambda f, c, t: (scale * f, c, t))(*rewards(*made)), settings=VELOCITY)
    assert finding("C9", settings=VELOCITY, transitions=small).verdict == "reproduced"


def test_points_of_other_irl_seeds_do_not_count():
    more = points(settings=VELOCITY.model_copy(update={"irl_seeds": tuple(range(10))}))
    assert {unit.value.n for unit in finding("C9", settings=VELOCITY, transitions=more).units} == {5}


def test_the_paper_is_reproduced_by_what_it_says():
    assert finding("C7", as_the_paper_says, settings=VELOCITY).verdict == "reproduced"
