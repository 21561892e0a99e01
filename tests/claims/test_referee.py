"""Made-up results that a referee tried on earlier criteria, with the verdict that each deserves, and what is near."""

import numpy as np
import pytest

from mtcsirl.claims.claims import claims_markdown, load_criteria
from mtcsirl.claims.judging import at_least, at_most, staying_below
from mtcsirl.results.statistics import Summary
from mtcsirl.settings import Settings
from tests.claims.made_up import (
    SETTINGS,
    WITHOUT,
    at,
    changed,
    fail_gates,
    finding,
    judge_all,
    points,
    transfer,
    verdict,
)

BASELINES = ("mt_airl", "mt_vairl", "mt_vairl_gp")


# --- a reward that repeats the task's own ---


def repeats_the_task(noise):
    """f = -r_task (and noise); the truth rises as r_task falls, so that f scores r = 0.77."""

    def make(key, partial, generator, count):
        t, u, v = generator.normal(size=(3, count))
        return -t + noise * v, -0.77 * t + np.sqrt(1 - 0.77**2) * u, t

    return points(make=make)


@pytest.mark.parametrize(("noise", "of_c9"), [(0.0, "inconclusive"), (0.1, "not reproduced")])
def test_minus_the_task_reward_neither_confirms_nor_refutes_a_correlation(noise, of_c9):
    """With nothing of its own there is no partial r to judge; with noise of its own the partial r is 0."""
    found = {f.name: f for f in judge_all(transitions=repeats_the_task(noise), names=("C4", "C9"))}
    assert found["C9"].verdict == of_c9
    assert found["C4"].verdict == "inconclusive", "r is large, but not by what the reward has learned"
    for unit in (*found["C4"].units, *found["C9"].units):
        assert unit.ours.mean == pytest.approx(0.77, abs=0.1), "r stands beside it"
    words = "says nothing beyond r_task" if noise == 0 else "partial r at least 0.7: not met"
    assert all(words in unit.reason for unit in found["C9"].units)


def test_a_reward_with_more_to_say_than_the_task_does():
    """The same truth, but f knows it: partial r = 0.9, and r surely larger than that of -r_task."""

    def make(key, partial, generator, count):
        t, u, v = generator.normal(size=(3, count))
        return -0.77 * t + np.sqrt(1 - 0.77**2) * u + 0.3 * v, -0.77 * t + np.sqrt(1 - 0.77**2) * u, t

    found = {f.name: f.verdict for f in judge_all(transitions=points(make=make), names=("C4", "C9"))}
    assert found == {"C4": "not reproduced", "C9": "reproduced"}


def test_a_partial_correlation_that_is_worse_than_the_control_is_no_correlation():
    """f knows what r_task leaves of the truth (partial r = 1), but runs against it where r_task speaks: r is near 0."""

    def make(key, partial, generator, count):
        t, u, v = generator.normal(size=(3, count))
        return 0.6 * t + u + 0.1 * v, -0.77 * t + np.sqrt(1 - 0.77**2) * u, t

    found = finding("C9", transitions=points(make=make))
    assert min(unit.value.value for unit in found.units) > 0.9
    assert found.verdict == "not reproduced"
    assert "r larger than that of -r_task: not met" in found.units[0].reason


def test_scored_sets_stand_beside_the_judged_number():
    notes = " ".join(finding("C9").units[0].notes)
    assert "r by set: expert -0.50, sac 0.30" in notes
    assert "5 IRL seeds, 15 agents, 70 episodes" in notes, "SAC, experts and random actions are shared"


# --- agents that are ruined ---


@pytest.mark.parametrize("part", [0.0, -0.5])
def test_a_ruined_agent_is_neither_like_sac_nor_proof_of_transfer(part):
    """At SAC's speed with success 0, and below it."""
    found = finding("C3", changed(lambda a: transfer(a, "single_target"), lambda a: at(a["cs_reward"], part, 0.0)))
    assert found.verdict == "not reproduced"
    assert {unit.outcome for unit in found.units} == {"agent ruined"}
    assert "10 with ruined agents" in found.reason
    assert "not met: agent ruined" in claims_markdown([found], SETTINGS)


def test_outcomes_of_c3_are_told_apart():
    def outcomes(part, success=1.0):
        means = changed(lambda a: transfer(a, "single_target"), lambda a: at(a["cs_reward"], part, success))
        return {unit.outcome for unit in finding("C3", means).units}

    assert outcomes(0.03) == {"like SAC"}
    assert outcomes(0.8) == {"behaviour transfers"}
    assert outcomes(-0.6) == {"farther than SAC"}


def test_ruined_agents_on_other_tasks_do_not_show_that_nothing_transfers():
    def ruined(agent):
        return transfer(agent, "multi_target") and agent["source"] != agent["task"]

    found = finding("C6", changed(ruined, lambda a: at(a["cs_reward"], 0.05, 0.2)))
    assert found.verdict == "not reproduced"
    assert {unit.outcome for unit in found.units} == {"agent ruined"}
    assert "10 with ruined agents" in found.reason


# --- judged per task ---


@pytest.mark.parametrize(("behind", "success"), [(-0.6, 1.0), (-0.6, 0.5)])
def test_full_transfer_to_two_tasks_is_not_hidden_by_harm_on_three(behind, success):
    tasks = ("reach-wall", "push-back")

    def off_diagonal(agent):
        return transfer(agent, "multi_target") and agent["source"] != agent["task"]

    def result(agent):
        return at(agent["cs_reward"], 0.95) if agent["task"] in tasks else at(agent["cs_reward"], behind, success)

    found = finding("C6", changed(off_diagonal, result))
    assert found.verdict == "not reproduced"
    assert all("behaviour transfers" in unit.outcome for unit in found.units)
    assert any("closes at most 25 % of SAC's gap: met" in unit.reason for unit in found.units), "the mean hides it"


def test_one_unseen_task_that_fails_alone_leaves_a_part():
    def fails(agent):
        return transfer(agent, "multi_task") and agent["task"] == "push-back"

    for name in ("C7", "C10"):
        found = finding(name, changed(fails, lambda a: at(a["cs_reward"], 0.0)))
        assert found.verdict == "partially"
        assert {unit.what for unit in found.units if unit.state == "not met"} == {"push-back"}


def test_baselines_that_lose_in_metric_alone_leave_a_part():
    def baseline(agent):
        return transfer(agent, "multi_task") and agent["method"] in BASELINES

    found = finding("C8", changed(baseline, lambda a: at(a["cs_reward"], 0.2)))
    assert found.verdict == "partially"
    assert {unit.what.split(", ")[1] for unit in found.units if unit.state == "met"} == {"metric"}
    found = finding("C8", changed(baseline, lambda a: at(a["cs_reward"], 0.95, 0.7)))
    assert {unit.what.split(", ")[1] for unit in found.units if unit.state == "met"} == {"success"}


# --- preconditions that can be reached ---


def test_the_ablation_has_the_seeds_that_a_verdict_needs():
    assert len(Settings().ablations.seeds) >= load_criteria()["seeds"]
    assert verdict("C12") == "reproduced"
    two = SETTINGS.ablations.model_copy(update={"seeds": (0, 1)})
    few = finding("C12", change=lambda rows: rows[(rows["experiment"] != WITHOUT) | (rows["seed"] < 2)])
    assert len(two.seeds) < load_criteria()["seeds"]
    assert few.verdict == "inconclusive"


@pytest.mark.parametrize("name", ["C5", "C6"])
def test_one_failed_expert_of_three_is_within_the_share(name):
    one = {"stage": "train_expert", "target": 1, "seed": 0}
    assert verdict(name, change=lambda rows: fail_gates(rows, **one)) == "reproduced"
    two = one | {"target": [1, 2]}
    assert verdict(name, change=lambda rows: fail_gates(rows, **two)) == "precondition not met"


def test_a_single_failed_expert_blocks_where_there_is_no_other():
    settings = SETTINGS.model_copy(update={"irl_seeds": (0,)})
    found = finding("C2", settings=settings, change=lambda rows: fail_gates(rows, stage="train_expert"))
    assert found.verdict == "precondition not met"
    assert "0 of 1 experts" in found.units[0].reason


# --- bounds, not means ---


def test_a_mean_on_the_right_side_is_not_enough():
    assert at_most(Summary(0.14, 0.5, 5), 0.15, "d")[0] == "unclear"
    assert at_most(Summary(0.14, 0.005, 5), 0.15, "d")[0] == "met"
    assert at_most(Summary(0.16, 0.005, 5), 0.15, "d")[0] == "not met"
    assert at_least(Summary(0.95, 0.2, 5), 0.9, "success")[0] == "unclear"
    assert at_least(Summary(0.9, 0.0, 5), 0.9, "success")[0] == "met", "on the limit, without any doubt"


def test_met_is_rare_where_the_truth_lies_beyond_the_limit():
    """True closure 40 %, limit 25 %, sd 0.4 of SAC's gap: the mean alone said "met" in 19 % of studies."""
    generator = np.random.default_rng(0)
    met = 0
    for far, sac in zip(generator.normal(0.6, 0.4, (500, 5)), generator.normal(1.0, 0.4, (500, 5)), strict=True):
        summaries = [Summary(x.mean(), x.std(ddof=1), 5) for x in (far, sac)]
        met += staying_below(*summaries, 0.25)[0] == "met"
    assert met / 500 < 0.05


# --- the thesis ---


def test_several_tasks_beat_one_only_where_the_one_works_at_home():
    def single(agent):
        return transfer(agent, "multi_target") and agent["source"] == "coffee-button"

    broken = changed(single, lambda a: at(a["cs_reward"], 0.0))
    assert verdict("C13", broken) == "precondition not met"
    lucky = changed(single, lambda a: at(a["cs_reward"], 0.9 if a["task"] == "coffee-button" else 0.8))
    assert verdict("C13", lucky) in ("not reproduced", "inconclusive"), "a lead of 5 % is less than 10 %"


def test_the_lead_over_one_task_is_paired_by_seed():
    """Both rewards of a seed suffer alike: unpaired, their spread would hide a lead of 30 % of the gap."""
    lag = {0: 0.0, 1: 0.2, 2: 0.4, 3: 0.6, 4: 0.8}

    def together(rows):
        new = (rows["stage"] == "transfer") & rows["task"].isin(SETTINGS.multi_task.unseen_tasks)
        for cs, gap in (("velocity", 0.48), ("action_norm", 1.43)):
            later = rows["value"] - gap * rows["seed"].map(lag)
            rows = rows.assign(value=rows["value"].mask(new & (rows["metric"] == cs), later))
        return rows

    def single(agent):
        return transfer(agent, "multi_target") and agent["source"] == "coffee-button" != agent["task"]

    found = finding("C13", changed(single, lambda a: at(a["cs_reward"], 0.55)), spread=0.01, change=together)
    assert all(unit.value.value == pytest.approx(0.3, abs=0.05) for unit in found.units)
    assert min(unit.difference.p for unit in found.units) > 0.1, "unpaired"
    assert found.verdict == "reproduced"


def test_a_study_without_a_shared_task_has_no_such_claim():
    tasks = SETTINGS.multi_target.model_copy(update={"tasks": ("reach-wall", "push-back")})
    found = finding("C13", settings=SETTINGS.model_copy(update={"multi_target": tasks}))
    assert (found.verdict, found.units) == ("not run", ())
