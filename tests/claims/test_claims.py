import json

import pytest

from mtcsirl.claims.claims import VERDICTS, claims_json, combine, judge
from mtcsirl.settings import Settings
from tests.claims.made_up import (
    CLAIMS,
    SETTINGS,
    WITHOUT,
    as_the_paper_says,
    at,
    changed,
    fail_gates,
    finding,
    judge_all,
    missing,
    off_diagonal,
    points,
    replicated,
    rewards,
    rows_of,
    scores,
    transfer,
    verdict,
    verdicts,
)


@pytest.fixture(scope="module")
def findings():
    return judge_all()


def test_a_study_as_the_paper_says_reproduces_every_claim(findings):
    assert {finding.name: finding.verdict for finding in findings} == dict.fromkeys(CLAIMS, "reproduced")
    assert tuple(f"C{number}" for number in range(1, 14)) == CLAIMS


NOT_REPRODUCED = {
    "experts stop half way": ("C1", lambda a: a["stage"] == "train_expert", lambda a: at(a["cs_reward"], 0.5)),
    "experts fail the task": ("C1", lambda a: a["stage"] == "train_expert", lambda a: at(a["cs_reward"], 1, 0.5)),
    "generator learns no behaviour": (
        "C2", lambda a: a["experiment"] == "single_target", lambda a: at(a["cs_reward"], 0.2)),
    "the single-task reward transfers": (
        "C3", lambda a: transfer(a, "single_target"), lambda a: at(a["cs_reward"], 0.8)),
    "no transfer to new targets": ("C5", lambda a: transfer(a, "multi_target"), lambda a: at(a["cs_reward"], 0.1)),
    "transfer that ruins the task": (
        "C5", lambda a: transfer(a, "multi_target"), lambda a: at(a["cs_reward"], 0.9, 0.5)),
    "an overshoot is no transfer": ("C5", lambda a: transfer(a, "multi_target"), lambda a: at(a["cs_reward"], 1.9)),
    "transfer to other tasks": ("C6", off_diagonal, lambda a: at(a["cs_reward"], 0.8)),
    "no transfer to unseen tasks": ("C7", lambda a: transfer(a, "multi_task"), lambda a: at(a["cs_reward"], 0.1)),
    "baselines as good": ("C8", lambda a: transfer(a, "multi_task"), lambda a: at(a["cs_reward"], 0.85)),
    "LT does not transfer": ("C10", lambda a: a["method"] == "mt_csirl_lt", lambda a: at(a["cs_reward"], 0.1)),
    "LT's rewards do not train": (
        "C11", lambda a: a["method"] == "mt_csirl_lt" and a["stage"] == "transfer",
        lambda a: at(a["cs_reward"], 0.9, 0.3)),
    "the curriculum does nothing": (
        "C12", lambda a: a["experiment"] == WITHOUT, lambda a: at(a["cs_reward"], 0.9)),
    "one task's reward does as well": (
        "C13", lambda a: transfer(a, "multi_target"), lambda a: at(a["cs_reward"], 0.84)),
    "several tasks' reward ruins what it wins": (
        "C13", lambda a: transfer(a, "multi_task"), lambda a: at(a["cs_reward"], 0.85, 0.3)),
}  # fmt: skip


@pytest.mark.parametrize("case", NOT_REPRODUCED)
def test_results_against_the_paper_are_not_reproduced(case):
    name, test, result = NOT_REPRODUCED[case]
    assert verdict(name, changed(test, result)) == "not reproduced"


AGAINST = [("C4", 0.8), ("C4", -0.8), ("C9", 0.2)]


@pytest.mark.parametrize(("name", "r"), AGAINST)
def test_correlations_against_the_paper_are_not_reproduced(name, r):
    transitions = points({"single_target": r, "multi_task": r})
    assert verdict(name, transitions=transitions) == "not reproduced"


def test_every_claim_has_a_study_in_which_it_does_not_come_out():
    assert {name for name, *_ in NOT_REPRODUCED.values()} | {name for name, _ in AGAINST} == set(CLAIMS)


def test_correlations_that_swing_between_seeds_decide_nothing():
    by_seed = {0: -0.6, 1: -0.2, 2: 0.1, 3: 0.4, 4: 0.8}

    def swinging(key, partial, generator, count):
        return rewards(key, by_seed[key["seed"]], generator, count)

    assert verdict("C4", transitions=points(make=swinging)) == "inconclusive"


def test_one_cs_reward_of_two_is_partial():
    only = changed(lambda a: transfer(a, "multi_task") and a["cs_reward"] == "velocity", lambda a: at("velocity", 0.1))
    assert verdict("C7", only) == "partially"
    assert verdict("C10", only) == "partially"


def test_one_task_of_five_is_spared():
    one = changed(
        lambda a: transfer(a, "multi_target") and a["source"] == a["task"] == "push-back",
        lambda a: at(a["cs_reward"], 0.1),
    )
    assert verdict("C5", one) == "reproduced", "4 of 5 tasks"
    half = changed(
        lambda a: transfer(a, "multi_target") and a["task"] in ("push-back", "reach-wall", "drawer-close"),
        lambda a: at(a["cs_reward"], 0.1),
    )
    assert verdict("C5", half) == "partially"


def test_noise_is_inconclusive_and_never_equivalence():
    """Transferred and SAC have equal means but spread so much that a large difference may hide."""

    def shaken(rows):
        wild = rows["stage"].isin(["transfer", "train_sac"]) & rows["metric"].isin(["velocity", "action_norm"])
        factor = rows["seed"].map({0: 0.2, 1: 0.6, 2: 1.0, 3: 1.4, 4: 1.8})
        return rows.assign(value=rows["value"].where(~wild, rows["value"] * factor))

    found = finding("C3", change=shaken)
    assert found.verdict == "inconclusive"
    assert "unclear" in {unit.state for unit in found.units}
    assert max(unit.power for unit in found.units) < 0.2, "and the power says why"


def test_a_small_but_certain_difference_is_still_equivalence():
    """A difference of 10 % of the gap is significant with little noise, and yet within the margin."""
    small = changed(lambda a: transfer(a, "single_target"), lambda a: at(a["cs_reward"], 0.1))
    found = finding("C3", small, spread=0.01)
    assert max(unit.difference.p for unit in found.units) < 0.05
    assert found.verdict == "reproduced"


@pytest.mark.parametrize("against", [False, True])
def test_fewer_than_five_seeds_are_inconclusive(against):
    """Whether the results say what the paper says or the opposite."""
    four = {"seeds": (0, 1, 2, 3)}
    ablations = SETTINGS.ablations.model_copy(update=four)
    settings = SETTINGS.model_copy(update={**four, "irl_seeds": four["seeds"], "ablations": ablations})
    flat = changed(lambda a: a["stage"] != "train_sac", lambda a: at(a["cs_reward"], 0.0, 0.4))
    opposite = points({"single_target": 0.9, "multi_task": 0.1}, settings)
    found = verdicts(
        flat if against else as_the_paper_says, settings=settings, transitions=opposite if against else None
    )
    assert set(found.values()) == {"inconclusive"}


def test_agents_that_share_a_learned_reward_are_not_independent():
    found = judge_all(settings=SETTINGS.model_copy(update={"irl_seeds": (0,)}))
    own = {"C1": "experts learn from no reward", "C12": "an ablation has IRL seeds of its own"}
    of_rewards = [finding for finding in found if finding.name not in own]
    assert {finding.verdict for finding in of_rewards} == {"inconclusive"}
    assert "1 of the 5 independent seeds" in of_rewards[0].units[0].reason
    assert {finding.verdict for finding in found if finding.name in own} == {"reproduced"}, own


def test_failed_experts_are_a_failed_precondition():
    found = verdicts(change=lambda rows: fail_gates(rows, stage="train_expert"))
    assert found.pop("C1") == "reproduced", "C1 is about the numbers of the experts themselves"
    assert set(found.values()) == {"precondition not met"}


def test_demonstrations_fail_the_precondition_where_their_expert_was_lucky():
    found = verdicts(change=lambda rows: fail_gates(replicated(rows), stage="collect_demonstrations"))
    assert found.pop("C1") == "reproduced", "C1 is about the experts' own episodes"
    assert set(found.values()) == {"precondition not met"}


def test_an_expert_and_its_own_demonstrations_count_once():
    def one_of_each(rows):
        rows = fail_gates(rows, stage="collect_demonstrations", task="reach")
        return fail_gates(rows, stage="train_expert", task="reach", seed=0)

    assert verdict("C7", change=one_of_each) == "reproduced", "five of six pass"
    blocked = verdict("C7", change=lambda rows: fail_gates(one_of_each(rows), stage="train_expert", task="door-close"))
    assert blocked == "precondition not met"


def test_a_broken_irl_confirms_no_claim_that_something_fails():
    found = verdicts(change=lambda rows: fail_gates(rows, stage="learn_reward"))
    assert {name for name, verdict in found.items() if verdict == "precondition not met"} == {
        "C3",
        "C4",
        "C6",
        "C12",
        "C13",
    }
    assert {found[name] for name in ("C2", "C5", "C7", "C10", "C11")} == {"reproduced"}


def test_failure_off_its_task_needs_success_on_it():
    useless = changed(lambda a: transfer(a, "multi_target"), lambda a: at(a["cs_reward"], 0.0))
    assert verdict("C6", useless) == "precondition not met"


def test_no_gap_no_verdict():
    on_target = changed(lambda a: a["stage"] == "train_sac", lambda a: {"velocity": 0.79, "action_norm": 2.95})
    assert verdict("C7", on_target) == "precondition not met"


def test_one_failed_expert_of_six_is_spared():
    one = {"stage": "train_expert", "task": "reach"}
    assert verdict("C7", change=lambda rows: fail_gates(rows, **one)) == "reproduced"
    two = one | {"task": ["reach", "door-close"]}
    assert verdict("C7", change=lambda rows: fail_gates(rows, **two)) == "precondition not met"


def test_every_irl_seed_needs_its_own_expert():
    """But of several targets all seeds imitate the first seed's, and the units say so."""

    def fail(seeds):
        return lambda rows: fail_gates(replicated(rows), stage="collect_demonstrations", seed=seeds)

    later = verdicts(change=fail([1, 2, 3, 4]))
    assert {name for name, verdict in later.items() if verdict != "precondition not met"} == {"C1", "C5", "C6"}
    assert verdict("C7", change=fail([3])) == "reproduced", "four of five"
    first = verdicts(change=fail([0]))
    assert {name for name, verdict in first.items() if verdict == "precondition not met"} == {"C5", "C6", "C13"}
    assert all("conditional on the experts" in " ".join(unit.notes) for unit in finding("C5").units)
    assert not any("conditional on the experts" in " ".join(unit.notes) for unit in finding("C7").units)


def test_missing_runs_are_not_run_and_not_failures():
    assert verdict("C7", change=lambda rows: missing(rows, stage="transfer")) == "not run"
    assert verdict("C3", change=lambda rows: missing(rows, stage="train_sac")) == "not run"
    one_seed = {"stage": "transfer", "experiment": "multi_task", "method": "mt_csirl", "seed": 4}
    assert verdict("C7", change=lambda rows: missing(rows, **one_seed)) == "inconclusive"


def test_claims_on_one_task_are_about_the_method_that_the_settings_name(findings):
    said = {"single_target": {"method": "mt_vairl"}, "multi_target": {"method": "mt_airl"}}
    study = SETTINGS.model_dump(mode="json")
    settings = Settings.model_validate(study | {name: study[name] | own for name, own in said.items()})
    assert verdicts(settings=settings) == {finding.name: finding.verdict for finding in findings}


def test_the_curriculum_claim_needs_its_ablation():
    without = finding("C12", change=lambda rows: rows[rows["experiment"] != WITHOUT])
    assert without.verdict == "not run"


def test_nothing_at_all_is_not_run():
    rows = rows_of(as_the_paper_says).iloc[:0]
    found = judge(rows, scores().iloc[:0], SETTINGS, points=points().iloc[:0])
    assert {finding.verdict for finding in found} == {"not run"}
    found = judge(rows, scores().iloc[:0], SETTINGS)
    assert {finding.verdict for finding in found} == {"not run"}
    text = json.dumps(claims_json(found, SETTINGS), allow_nan=False)
    assert "NaN" not in text


def test_smoke_scale_decides_nothing():
    assert verdict("C5", settings=SETTINGS.model_copy(update={"scale": "smoke"})) == "inconclusive"


@pytest.mark.parametrize(
    ("states", "expected"),
    [
        (["met"] * 4 + ["not met"], "reproduced"),
        (["met"] * 4 + ["unclear"], "reproduced"),
        (["met"] * 3 + ["unclear", "not met"], "inconclusive"),
        (["met"] * 3 + ["not met"] * 2, "partially"),
        (["not met"] * 5, "not reproduced"),
        (["not met"] * 2 + ["unclear"] * 3, "not reproduced"),
        (["not met"] + ["unclear"] * 4, "inconclusive"),
        (["too few seeds"] * 5, "inconclusive"),
        (["met"] * 4 + ["not run"], "reproduced"),
        (["met"] * 3 + ["not run"] * 2, "not run"),
        (["met"] * 3 + ["precondition not met"] * 2, "precondition not met"),
        (["not judged"] * 5 + ["met"], "reproduced"),
        (["not judged"] * 5, "not run"),
        ([], "not run"),
    ],
)
def test_verdict_over_units(states, expected):
    assert combine(states, 0.8)[0] == expected


def test_every_verdict_is_reached_above():
    reached = {"reproduced", "partially", "not reproduced", "inconclusive", "precondition not met", "not run"}
    assert reached == set(VERDICTS)
