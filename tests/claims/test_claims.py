import json

import pandas as pd
import pytest

from mtcsirl.claims.claims import VERDICTS, claims_json, claims_markdown, combine, judge, load_criteria
from mtcsirl.claims.evidence import Group
from mtcsirl.claims.judging import MET, NOT_MET, closing
from mtcsirl.claims.unit_text import COLUMNS, unit_texts
from mtcsirl.results.rows import select
from mtcsirl.results.statistics import Summary
from mtcsirl.settings import Settings
from tests.claims.made_up import (
    CORRELATIONS,
    SETTINGS,
    as_the_paper_says,
    at,
    changed,
    finding,
    judge_all,
    rows_of,
    scores,
    verdict,
    verdicts,
)

CLAIMS = tuple(load_criteria()["claims"])


@pytest.fixture(scope="module")
def findings():
    return judge(rows_of(as_the_paper_says), scores(), SETTINGS)


def test_a_study_as_the_paper_says_reproduces_every_claim(findings):
    assert {finding.name: finding.verdict for finding in findings} == dict.fromkeys(CLAIMS, "reproduced")
    assert tuple(f"C{number}" for number in range(1, 13)) == CLAIMS


def transfer(agent, experiment):
    return agent["stage"] == "transfer" and agent["experiment"] == experiment


def off_diagonal(agent):
    return transfer(agent, "multi_target") and agent["source"] != agent["task"]


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
    "baselines fail the task alone": (
        "C8", lambda a: transfer(a, "multi_task") and a["method"] in ("mt_airl", "mt_vairl", "mt_vairl_gp"),
        lambda a: at(a["cs_reward"], 0.95, 0.7)),
    "LT does not transfer": ("C10", lambda a: a["method"] == "mt_csirl_lt", lambda a: at(a["cs_reward"], 0.1)),
    "LT's rewards do not train": (
        "C11", lambda a: a["method"] == "mt_csirl_lt" and a["stage"] == "transfer",
        lambda a: at(a["cs_reward"], 0.9, 0.3)),
    "the curriculum does nothing": (
        "C12", lambda a: a["experiment"] == "ablation_curriculum", lambda a: at(a["cs_reward"], 0.9)),
}  # fmt: skip


@pytest.mark.parametrize("case", NOT_REPRODUCED)
def test_results_against_the_paper_are_not_reproduced(case):
    name, test, result = NOT_REPRODUCED[case]
    assert verdict(name, changed(test, result)) == "not reproduced"


@pytest.mark.parametrize(("name", "r"), [("C4", 0.8), ("C4", -0.8), ("C9", 0.2)])
def test_correlations_against_the_paper_are_not_reproduced(name, r):
    assert verdict(name, correlations={"single_target": r, "multi_task": r}) == "not reproduced"


def test_correlations_that_swing_between_seeds_decide_nothing():
    by_seed = {0: -0.6, 1: -0.2, 2: 0.1, 3: 0.4, 4: 0.8}
    assert verdict("C4", rescore=lambda frame: frame.assign(value=frame["seed"].map(by_seed))) == "inconclusive"


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


def test_a_small_but_certain_difference_is_still_equivalence():
    """A difference of 10 % of the gap is significant with little noise, and yet within the margin."""
    small = changed(lambda a: transfer(a, "single_target"), lambda a: at(a["cs_reward"], 0.1))
    found = finding("C3", small, spread=0.01)
    assert max(unit.difference.p for unit in found.units) < 0.05
    assert found.verdict == "reproduced"


@pytest.mark.parametrize("against", [False, True])
def test_fewer_than_five_seeds_are_inconclusive(against):
    """Whether the results say what the paper says or the opposite."""
    settings = SETTINGS.model_copy(update={"seeds": (0, 1, 2, 3), "irl_seeds": (0, 1, 2, 3)})
    flat = changed(lambda a: a["stage"] != "train_sac", lambda a: at(a["cs_reward"], 0.0, 0.4))
    found = verdicts(
        flat if against else as_the_paper_says,
        settings=settings,
        correlations={"single_target": 0.9, "multi_task": 0.1} if against else CORRELATIONS,
    )
    assert set(found.values()) == {"inconclusive"}


def test_agents_that_share_a_learned_reward_are_not_independent():
    found = judge_all(settings=SETTINGS.model_copy(update={"irl_seeds": (0,)}))
    of_rewards = [finding for finding in found if finding.name != "C1"]
    assert {finding.verdict for finding in of_rewards} == {"inconclusive"}
    assert "1 of the 5 independent seeds" in of_rewards[0].units[0].reason
    assert found[0].verdict == "reproduced", "experts learn from no reward"


def fail_gates(rows, **key):
    failed = rows.index.isin(select(rows, **key).index)
    return rows.assign(status=rows["status"].mask(failed, "below gate"))


def test_failed_experts_are_a_failed_precondition():
    found = verdicts(change=lambda rows: fail_gates(rows, stage="train_expert"))
    assert found.pop("C1") == "reproduced", "C1 is about the numbers of the experts themselves"
    assert set(found.values()) == {"precondition not met"}


def test_demonstrations_fail_the_precondition_where_their_expert_was_lucky():
    found = verdicts(change=lambda rows: fail_gates(rows, stage="collect_demonstrations"))
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
    assert {name for name, verdict in found.items() if verdict == "precondition not met"} == {"C3", "C4", "C6"}
    assert {found[name] for name in ("C2", "C5", "C7", "C10", "C11")} == {"reproduced"}


def test_failure_off_its_task_needs_success_on_it():
    useless = changed(lambda a: transfer(a, "multi_target"), lambda a: at(a["cs_reward"], 0.0))
    assert verdict("C6", useless) == "precondition not met"


def test_no_gap_no_verdict():
    on_target = changed(lambda a: a["stage"] == "train_sac", lambda a: {"velocity": 0.79, "action_norm": 2.95})
    assert verdict("C7", on_target) == "precondition not met"


def test_one_failed_expert_of_six_is_spared():
    one = {"stage": "train_expert", "task": "reach", "seed": 0}
    assert verdict("C7", change=lambda rows: fail_gates(rows, **one)) == "reproduced"
    two = one | {"task": ["reach", "door-close"]}
    assert verdict("C7", change=lambda rows: fail_gates(rows, **two)) == "precondition not met"


def missing(rows, **key):
    gone = rows.index.isin(select(rows, **key).index)
    return rows.assign(value=rows["value"].mask(gone), status=rows["status"].mask(gone, "missing"))


def test_missing_runs_are_not_run_and_not_failures():
    assert verdict("C7", change=lambda rows: missing(rows, stage="transfer")) == "not run"
    assert verdict("C3", change=lambda rows: missing(rows, stage="train_sac")) == "not run"
    one_seed = {"stage": "transfer", "experiment": "multi_task", "method": "mt_csirl", "seed": 4}
    assert verdict("C7", change=lambda rows: missing(rows, **one_seed)) == "inconclusive"


def test_the_curriculum_claim_needs_its_ablation():
    without = finding("C12", change=lambda rows: rows[rows["experiment"] != "ablation_curriculum"])
    assert without.verdict == "not run"


def test_nothing_at_all_is_not_run():
    rows = rows_of(as_the_paper_says).iloc[:0]
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
        ([], "not run"),
    ],
)
def test_verdict_over_units(states, expected):
    assert combine(states, 0.8)[0] == expected


def test_every_verdict_is_reached_above():
    reached = {"reproduced", "partially", "not reproduced", "inconclusive", "precondition not met", "not run"}
    assert reached == set(VERDICTS)


def test_closing_by_hand():
    """SAC misses by 0.48; an agent that misses by 0.08 closes 5/6 of the gap; one that misses by 0.40 one sixth."""
    sac = Summary(0.48, 0.02, 5)
    assert closing(Summary(0.08, 0.02, 5), sac, 0.5)[0] == MET
    assert closing(Summary(0.40, 0.02, 5), sac, 0.5)[0] == NOT_MET
    assert closing(Summary(0.22, 0.30, 5), sac, 0.5)[0] == "unclear"
    assert closing(Summary(0.30, 0.30, 5), sac, 0.5)[0] == "unclear"


def test_falling_short_and_overshooting_count_alike():
    frame = pd.DataFrame({"velocity": [0.7, 0.9], "success": [1.0, 1.0]}, index=[0, 1])
    group = Group("transfer", {"reach": frame}, "velocity", 0.8)
    assert group.distance.mean == pytest.approx(0.1)


def test_numbers_of_a_unit_are_those_of_the_rows(findings):
    """MT-CSIRL, velocity: against the same numbers taken from the rows by hand."""
    rows = select(rows_of(as_the_paper_says), metric="velocity", policy="stochastic", target=0)
    ours = select(rows, stage="transfer", experiment="multi_task", method="mt_csirl", cs_reward="velocity")
    ours = ours[ours["task"].isin(SETTINGS.multi_task.unseen_tasks)].groupby("seed")["value"].mean()
    unit = next(u for f in findings if f.name == "C7" for u in f.units if u.cs_reward == "velocity")
    assert unit.ours == pytest.approx((ours.mean(), ours.std(), 5))
    assert unit.paper == (0.73, 0.07, 5)
    assert unit.inside is True
    assert unit.closer == 1.0
    assert unit.effect.value > 5


def test_json_and_markdown_show_all_that_was_judged(findings):
    data = json.loads(json.dumps(claims_json(findings, SETTINGS), allow_nan=False))
    assert [claim["name"] for claim in data["claims"]] == list(CLAIMS)
    unit = next(c for c in data["claims"] if c["name"] == "C7")["units"][0]
    assert unit["published"]["prediction_interval"]["low"] == pytest.approx(2.434, abs=1e-3)
    assert unit["hedges_g"]["low"] < unit["hedges_g"]["value"] < unit["hedges_g"]["high"]
    assert list(unit["texts"]) == list(COLUMNS)
    assert unit["measure"]["published"] == pytest.approx(1 - 0.25 / 1.43, abs=1e-6)
    text = claims_markdown(findings, SETTINGS)
    assert all(f"### {name}: reproduced" in text for name in CLAIMS)
    rows = [line for line in text.splitlines() if line.startswith("| action norm, unseen tasks")]
    assert rows
    assert {row.count(" | ") for row in rows} == {len(COLUMNS) - 1}


def test_criteria_of_a_unit_stand_side_by_side(findings):
    """MT-CSIRL, velocity: about 0.73 m/s, as in the paper; SAC moves at 0.32."""
    unit = next(u for f in findings if f.name == "C7" for u in f.units if u.cs_reward == "velocity")
    texts = unit_texts(unit)
    assert texts["paper"] == "0.73±0.07"
    assert texts["ours_in_prediction"] == "yes [0.61, 0.85]"
    assert texts["measure"].startswith("part of SAC's gap closed: 0.8")
    assert texts["measure"].endswith("; paper 0.85")
    assert texts["difference"].startswith("SAC: yes, +0.4")
    assert texts["difference"].endswith("p < 0.001")
    assert texts["effect"].endswith("closer with probability 1.00")
    nothing = unit_texts(finding("C7", change=lambda rows: missing(rows, stage="transfer")).units[0])
    assert nothing["judged"] == "not run"
    assert {nothing[name] for name in ("ours", "measure", "ours_in_prediction", "difference", "effect")} == {"–"}


@pytest.mark.parametrize(
    ("name", "cs_reward", "what", "expected"),
    [
        ("C1", "velocity", "reach-wall", 0.01 / 0.8),
        ("C4", "velocity", "reach-wall", 0.18),
        ("C5", "velocity", "reach-wall", 1 - 0.07 / 0.63),
        ("C6", "velocity", "reach-wall", 1 - (1 - 0.37) / (1 - 0.26)),
        ("C8", "velocity", "mt_airl", (0.69 - 0.07) / 0.48),
        ("C10", "action_norm", "unseen tasks", 1 - 0.3 / 1.43),
        ("C11", "velocity", "reach", 0.11),
    ],
)
def test_the_papers_numbers_are_put_on_the_scale_of_the_criterion(findings, name, cs_reward, what, expected):
    units = next(found.units for found in findings if found.name == name)
    unit = next(unit for unit in units if (unit.cs_reward, unit.what) == (cs_reward, what))
    assert unit.paper_value == pytest.approx(expected, abs=1e-9)


def test_every_claim_with_agents_has_an_effect_size(findings):
    without = {found.name for found in findings if not all(unit.effect.n for unit in found.units)}
    assert without == {"C4", "C9"}, "there r itself is the effect size"


def test_every_claim_states_its_criterion():
    for claim in load_criteria()["claims"].values():
        assert all(claim[name].strip() for name in ("text", "locus", "criterion"))


def test_an_own_cs_reward_is_judged_without_the_papers_numbers():
    settings = Settings(cs_rewards=("velocity",))
    found = finding("C7", settings=settings)
    assert found.verdict == "reproduced"
    assert len(found.units) == 1
