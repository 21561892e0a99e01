import json
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from mtcsirl.claims.claims import claims_json, claims_markdown, load_criteria
from mtcsirl.claims.groups import Group
from mtcsirl.claims.judging import MET, NOT_MET, closing
from mtcsirl.claims.unit_text import COLUMNS, unit_texts
from mtcsirl.results.rows import select
from mtcsirl.results.statistics import Summary
from mtcsirl.settings import Settings
from tests.claims.made_up import CLAIMS, SETTINGS, as_the_paper_says, finding, judge_all, missing, rows_of


@pytest.fixture(scope="module")
def findings():
    return judge_all()


def test_closing_by_hand():
    """SAC misses by 0.48; an agent that misses by 0.08 closes 5/6 of the gap; one that misses by 0.40 one sixth."""
    sac = Summary(0.48, 0.02, 5)
    assert closing(Summary(0.08, 0.02, 5), sac, 0.5)[0] == MET
    assert closing(Summary(0.40, 0.02, 5), sac, 0.5)[0] == NOT_MET
    assert closing(Summary(0.22, 0.30, 5), sac, 0.5)[0] == "unclear"
    assert closing(Summary(0.30, 0.30, 5), sac, 0.5)[0] == "unclear"


def test_falling_short_and_overshooting_count_alike():
    frame = pd.DataFrame({"velocity": [0.7, 0.9], "success": [1.0, 1.0]}, index=[0, 1])
    group = Group("transfer", "new agents", {"reach": frame}, "velocity", 0.8, 10)
    assert group.distance.mean == pytest.approx(0.1)


def test_numbers_of_a_unit_are_those_of_the_rows(findings):
    """MT-CSIRL, velocity, mean over unseen tasks: against the same numbers taken from the rows by hand."""
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
    titles = [f"{name} (gate)" if name in ("C1", "C2") else name for name in CLAIMS]
    assert all(f"### {title}: reproduced" in text for title in titles)
    rows = [line for line in text.splitlines() if line.startswith("| action norm, all unseen tasks")]
    assert rows
    assert {row.count(" | ") for row in rows} == {len(COLUMNS) - 1}


def test_what_was_not_fixed_beforehand_and_what_leans_is_said(findings):
    text, data = claims_markdown(findings, SETTINGS), claims_json(findings, SETTINGS)
    assert "Preconditions, settings and the reading of each claim were not" in text
    assert "Thresholds were fixed before" in data["beforehand"]
    assert [claim["name"] for claim in data["claims"] if claim["role"] == "gate"] == ["C1", "C2"]
    leaning = {claim["name"] for claim in data["claims"] if claim["departures"]}
    assert leaning == {"C1", "C2", "C3", "C4", "C7", "C8", "C9", "C10", "C12", "C13"}
    assert "- Leans against the claim: R_MAX from the experts, warm-up" in text.split("### C3")[1].split("### C4")[0]
    for claim in load_criteria()["claims"].values():
        assert all(departure["leans"] in ("for", "against") for departure in claim.get("departures", ()))


def test_criteria_of_a_unit_stand_side_by_side(findings):
    """MT-CSIRL, velocity: about 0.73 m/s, as in the paper; SAC moves at 0.32."""
    unit = next(u for f in findings if f.name == "C7" for u in f.units if u.cs_reward == "velocity")
    texts = unit_texts(unit)
    assert texts["paper"] == "0.73±0.07"
    assert texts["ours_in_prediction"].startswith("yes [0.61, 0.85], uninformative: spreads 0.07 and 0.00")
    alike = replace(unit, ours=Summary(0.73, 0.06, 5))
    assert unit_texts(alike)["ours_in_prediction"] == "yes [0.61, 0.85]"
    assert texts["measure"].startswith("part of SAC's gap closed: 0.8")
    assert texts["measure"].endswith("; paper 0.85")
    assert texts["difference"].startswith("SAC: yes, +0.4")
    assert texts["difference"].endswith("p < 0.001")
    assert texts["effect"].endswith("closer with probability 1.00")
    nothing = unit_texts(finding("C7", change=lambda rows: missing(rows, stage="transfer")).units[1])
    assert nothing["judged"] == "not run"
    assert {nothing[name] for name in ("ours", "measure", "ours_in_prediction", "difference", "effect")} == {"–"}


@pytest.mark.parametrize(
    ("name", "cs_reward", "what", "expected"),
    [
        ("C1", "velocity", "reach-wall", 0.01 / 0.8),
        ("C4", "velocity", "reach-wall", 0.18),
        ("C5", "velocity", "reach-wall", 1 - 0.07 / 0.63),
        ("C6", "velocity", "reach-wall", 1 - (1 - 0.37) / (1 - 0.26)),
        ("C8", "velocity", "MT-AIRL, metric", (0.69 - 0.07) / 0.48),
        ("C8", "action_norm", "MT-VAIRL, success", 0.999 - 0.796),
        ("C10", "action_norm", "push-back", 1 - 0.3 / 1.43),
        ("C11", "velocity", "reach", 0.11),
        ("C13", "velocity", "drawer-close", (1 - 0.07 / 0.48) - (1 - (1 - 0.35) / (1 - 0.26))),
    ],
)
def test_the_papers_numbers_are_put_on_the_scale_of_the_criterion(findings, name, cs_reward, what, expected):
    units = next(found.units for found in findings if found.name == name)
    unit = next(unit for unit in units if (unit.cs_reward, unit.what) == (cs_reward, what))
    assert unit.paper_value == pytest.approx(expected, abs=1e-9)


def test_a_part_of_an_unsure_gap_has_no_finite_bounds():
    def shaky(rows):
        """SAC all around the target, far in two seeds."""
        own = (rows["stage"] == "train_sac") & (rows["metric"] == "velocity")
        return rows.assign(value=rows["value"].mask(own, rows["seed"].map({0: 0.8, 1: 0.79, 2: 0.2, 3: 0.81, 4: 0.0})))

    unit = next(u for u in finding("C5", change=shaky).units if u.cs_reward == "velocity")
    assert unit.state == "unclear"
    assert (unit.value.low, unit.value.high) == (-np.inf, np.inf)
    assert "[no finite bounds: SAC's gap is not surely there]" in unit_texts(unit)["measure"]
    measure = claims_json([finding("C5", change=shaky)], SETTINGS)["claims"][0]["units"][-1]["measure"]
    assert measure["low"] is measure["high"] is None


def test_what_single_steps_say_stands_beside_where_it_was_recorded():
    """An action norm that alternates between 2 and 4 is 3 in the mean, and 1 off in every step."""

    def with_steps(rows):
        steps = rows["metric"].str.endswith("_distance")
        return rows.assign(value=rows["value"].mask(steps, 1.0))

    def without(rows):
        return rows[~rows["metric"].str.endswith("_distance")]

    unit = finding("C1", change=with_steps).units[0]
    assert "E|m - tau| of single steps 1.00±0.00; |E m - tau| 0.0" in unit_texts(unit)["notes"]
    assert "E|m" not in unit_texts(finding("C1", change=without).units[0])["notes"]
    text = claims_markdown([finding("C1", change=with_steps)], SETTINGS)
    assert "E\\|m - tau\\|" in text, "a bar would end the cell"


def test_kept_policies_are_judged_and_the_last_ones_noted():
    def with_last(rows):
        two = rows["stage"].isin(["train_expert", "train_sac"])
        last = rows[two].assign(kept="last", value=rows["value"] / 2)
        return pd.concat([rows.assign(kept=np.where(two, "kept", "")), last], ignore_index=True)

    expert = finding("C1", change=with_last).units[0]
    assert expert.state == "met"
    assert expert.value == finding("C1").units[0].value
    assert "kept policies; the last ones: 1.51, here 3.02" in expert.notes
    agent = finding("C3", change=with_last).units[0]
    assert agent.state == "met"
    assert any(note.startswith("SAC: kept policies; the last ones: 0.7") for note in agent.notes)


@pytest.mark.parametrize(("cs_reward", "ours", "answer"), [("velocity", 0.73, "met"), ("velocity", 0.80, "unclear")])
def test_not_as_strongly_as_the_ground_truth_is_noted(cs_reward, ours, answer):
    def at_speed(rows):
        own = (rows["stage"] == "transfer") & (rows["metric"] == "velocity") & (rows["cs_reward"] == "velocity")
        value = ours + 0.02 * (rows["seed"] - 2)
        return rows.assign(value=rows["value"].mask(own, value))

    unit = next(u for u in finding("C7", change=at_speed).units if u.cs_reward == cs_reward)
    assert (unit.what, unit.state) == ("all unseen tasks", "not judged")
    assert f'"not as strongly as the ground truth": {answer}; d less the experts\' is +0.0' in unit_texts(unit)["notes"]


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
    assert {unit.cs_reward for unit in found.units} == {"velocity"}


@pytest.mark.parametrize("lost", ["nothing", "push-back"])
def test_the_mean_over_tasks_never_counts(lost):
    """A task whose agents are missing leaves no mean over tasks: one unit of four per cs-reward is not run, not two."""
    found = finding("C7", change=lambda rows: missing(rows, stage="transfer", method="mt_csirl", task=lost))
    assert [unit.state for unit in found.units if unit.what == "all unseen tasks"] == ["not judged"] * 2
    assert found.reason.endswith("of 8 units")
    assert ("2 not run" in found.reason) == (lost == "push-back")


def test_r_itself_is_called_r(findings):
    """Beside a partial correlation; a speed is no r."""
    texts = {f.name: unit_texts(f.units[0]) for f in findings}
    assert texts["C9"]["ours"].startswith("r = 0.")
    assert texts["C9"]["paper"] == "r = 0.86", "action norm"
    assert not texts["C7"]["ours"].startswith("r = ")
