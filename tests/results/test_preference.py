"""Whether a learned reward pays new agents more than experts, on made-up policies in real worlds."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import torch

from mtcsirl.episodes.demonstrations import collect_demonstrations
from mtcsirl.episodes.policy import Policy, save_policy
from mtcsirl.errors import UserError
from mtcsirl.results.preference import EXPERT, NEW, SAC, paid, preferences, preferences_markdown, read_preferences
from mtcsirl.rewards.learned import LearnedReward, load_learned_reward, save_learned_reward
from mtcsirl.rewards.networks import RewardNetwork
from mtcsirl.settings import EvaluationSettings, Settings
from mtcsirl.settings.runs import DemonstrationRunSettings
from mtcsirl.study.design import design
from mtcsirl.study.runs import Runs, Transfer

STEPS = 20
SCALE = 3.0
LINEAR = {
    "kind": "perceptron", "observation_size": 39, "action_size": 4, "hidden_sizes": [],
    "output_scale": SCALE, "shaping": False, "discount": 0.99,
}  # fmt: skip
FIRST_ACTION = {NEW: 0.9, EXPERT: -0.5, SAC: 0.1}


def settings(results: Path, **changes: object) -> Settings:
    return Settings(
        seeds=(0, 1),
        irl_seeds=(0, 1),
        cs_rewards=("velocity",),
        methods=("mt_csirl", "mt_csirl_lt"),
        single_target={"tasks": ("reach",)},
        multi_target={"tasks": ("reach",), "train_targets": (1,)},
        multi_task={"train_tasks": ("reach", "door-close"), "train_targets": (0,), "unseen_tasks": ("drawer-close",)},
        evaluation=EvaluationSettings(episodes=2, episode_steps=STEPS),
        results=str(results),
        **changes,
    )


def first_action(value: float) -> Policy:
    """A policy of which the first action is ``value`` and the others are 0, almost surely."""
    bias = np.array([np.arctanh(value), 0, 0, 0, -20, -20, -20, -20], np.float32)
    return Policy((np.zeros((6, 39), np.float32), np.zeros((8, 6), np.float32)), (np.zeros(6, np.float32), bias))


def pays_first_action(members: tuple[tuple[str, int], ...], method: str, weight: float = 1.0) -> LearnedReward:
    """f = SCALE x weight x the first action; of MT-CSIRL+LT r_phi_t = SCALE x (member's place + 1)."""
    parameters = torch.zeros(1, 83)
    parameters[0, 39] = weight
    network = RewardNetwork.from_parameters(LINEAR, parameters)
    if method != "mt_csirl_lt":
        return LearnedReward(network, method, "velocity", "mapped", members)
    own = torch.zeros(len(members), 83)
    own[:, 82] = torch.arange(1.0, len(members) + 1)
    task = RewardNetwork.from_parameters(LINEAR, own)
    return LearnedReward(network, method, "velocity", "mapped", members, 0.0, task, (0.0,) * len(members))


def write(results: Path, weight: float = 1.0) -> tuple[Runs, Settings]:
    """A study in which each kind of agent has its own first action and rewards pay for that."""
    at = settings(results)
    study = design(at)
    for irl in study.irl_runs:
        save_learned_reward(pays_first_action(irl.members, irl.method, weight), results / irl.folder)
    for name, runs in ((NEW, study.transfers), (EXPERT, study.experts), (SAC, study.baselines)):
        for run in runs:
            save_policy(first_action(FIRST_ACTION[name]), results / run.folder)
    return study, at


def of(study: Runs, method: str = "mt_csirl", task: str = "drawer-close") -> list[Transfer]:
    return [
        run for run in study.transfers
        if (run.irl.experiment, run.irl.method, run.task) == ("multi_task", method, task)
    ]  # fmt: skip


def rows_of(study: Runs, at: Settings, transfers: list[Transfer]) -> pd.DataFrame:
    return read_preferences(transfers, study.experts, study.baselines, at)


def test_a_reward_for_what_new_agents_do_prefers_them(tmp_path: Path) -> None:
    study, at = write(tmp_path)
    rows = rows_of(study, at, of(study))
    f = rows.groupby("behaviour")["f"].mean()
    for name, value in FIRST_ACTION.items():
        assert f[name] == pytest.approx(SCALE * value, abs=1e-3)
    assert (rows["paid"] - rows["r_task"] - rows["f"]).abs().max() < 1e-5
    (found,) = preferences(rows).to_dict("records")
    assert (found["prefers"], found["prefers_from_start"], found["n"]) == (2, 2, 2)
    r_task = rows.groupby("behaviour")["r_task"].mean()
    assert found["beyond"] == pytest.approx(SCALE * 1.4 + r_task[NEW] - r_task[EXPERT], abs=1e-3)
    assert "2 of 2 | 2 of 2 |" in preferences_markdown(rows)


@pytest.mark.parametrize(
    ("new", "expert", "even"),
    [((6.5, -9.0), (9.6, -17.6), 0.36), ((9.0, -1.0), (8.0, -2.0), np.nan), ((8.0, -2.0), (8.0, -1.0), np.nan)],
)
def test_where_task_and_behaviour_are_even(new: tuple[float, float], expert: tuple[float, float], even: float) -> None:
    key = {"experiment": "multi_task", "method": "m", "cs_reward": "c", "source": "all", "task": "reach", "target": 0}
    rows = pd.DataFrame(
        key
        | {"seed": 0, "behaviour": name, "r_task": r, "f": f, "paid": r + f, "paid_from_start": r + f, "success": 1.0}
        for name, (r, f) in ((NEW, new), (EXPERT, expert))
    )
    (found,) = preferences(rows).to_dict("records")
    assert found["even_at"] == pytest.approx(even, abs=0.005, nan_ok=True)


def test_a_reward_for_what_experts_do_does_not(tmp_path: Path) -> None:
    study, at = write(tmp_path, weight=-1.0)
    (found,) = preferences(rows_of(study, at, of(study))).to_dict("records")
    assert (found["prefers"], found["prefers_from_start"], found["n"]) == (0, 0, 2)
    assert found["beyond"] < 0


def test_the_weight_of_training_counts(tmp_path: Path) -> None:
    study, at = write(tmp_path)
    other = settings(tmp_path, transfer=at.transfer.model_copy(update={"cs_weight": 0.5}))
    half, whole = (rows_of(study, one, of(study)[:1])["f"].to_numpy() for one in (other, at))
    assert half == pytest.approx(whole / 2)


def test_learned_task_rewards_are_what_pays_where_they_were_learned(tmp_path: Path) -> None:
    study, at = write(tmp_path)
    (first,) = rows_of(study, at, of(study, "mt_csirl_lt", "reach")[:1]).query("behaviour == 'expert'")["r_task"]
    place = of(study, "mt_csirl_lt", "reach")[0].irl.members.index(("reach", 0))
    assert first == pytest.approx(SCALE * (place + 1), abs=1e-3)
    known = rows_of(study, at, of(study, "mt_csirl_lt", "drawer-close")[:1])
    same = rows_of(study, at, of(study, "mt_csirl", "drawer-close")[:1])
    assert known["r_task"].to_list() == same["r_task"].to_list(), "unseen: the known one"


def test_from_resets_a_constant_pays_what_the_discount_leaves(tmp_path: Path) -> None:
    study, at = write(tmp_path)
    run = of(study, "mt_csirl_lt", "reach")[0]
    folder = tmp_path / run.irl.folder
    asked = DemonstrationRunSettings(environment=at.environment, episodes=2, episode_steps=STEPS)
    frame = collect_demonstrations(first_action(0.0), "reach", 0, asked, seed=0)
    found = paid(frame, load_learned_reward(folder), run, at)
    discount = run.settings(at).sac.discount
    assert found["paid_from_start"] == pytest.approx(found["paid"] * (1 - discount**STEPS), abs=1e-4)
    assert found["episodes"] == 2


def test_agents_without_an_expert_are_rows_and_no_verdict(tmp_path: Path) -> None:
    study, at = write(tmp_path)
    rows = read_preferences(of(study), [run for run in study.experts if run.seed == 1], (), at)
    assert rows.groupby("behaviour").size().to_dict() == {NEW: 2, EXPERT: 1}
    (found,) = preferences(rows).to_dict("records")
    assert found["n"] == 1
    assert np.isnan(found["low"])
    alone = read_preferences(of(study), (), (), at)
    assert preferences(alone).empty
    assert "No new agent has an expert" in preferences_markdown(alone)


def made_up(behaviour: str, seeds: range, r_task: tuple[float, ...], f: float) -> list[dict[str, object]]:
    """Rows of one behaviour; ``r_task`` of its seeds in turn."""
    key = {"experiment": "multi_task", "method": "m", "cs_reward": "c", "source": "all", "task": "reach", "target": 0}
    return [
        key
        | {"seed": seed, "behaviour": behaviour, "r_task": own, "f": f, "paid": own + f, "paid_from_start": own + f}
        | {"success": 1.0, "episodes": 4}
        for seed, own in zip(seeds, r_task, strict=True)
    ]


def test_means_are_over_pairs_so_that_one_lost_expert_costs_one_pair() -> None:
    """Over all five new agents these would have more r_task than their experts, and nothing would be even."""
    new = made_up(NEW, range(5), (1.0, 1.0, 9.0, 9.0, 9.0), 4.0)
    experts = made_up(EXPERT, range(2), (5.0, 5.0), 2.0)
    (found,) = preferences(pd.DataFrame(new + experts)).to_dict("records")
    (pairs,) = preferences(pd.DataFrame(new[:2] + experts)).to_dict("records")
    assert found == pairs
    assert (found["n"], found[f"r_task {NEW}"], found[f"r_task {EXPERT}"]) == (2, 1.0, 5.0)
    assert found["even_at"] == pytest.approx(2.0)
    assert found["beyond"] == found[f"paid {NEW}"] - found[f"paid {EXPERT}"]


def test_plain_sac_counts_beside_pairs_and_says_its_own_number() -> None:
    pairs = made_up(NEW, range(3), (1.0, 2.0, 3.0), 4.0) + made_up(EXPERT, range(1, 4), (5.0, 5.0, 5.0), 2.0)
    rows = pd.DataFrame(pairs + made_up(SAC, range(2), (100.0, 7.0), 1.0))
    (found,) = preferences(rows).to_dict("records")
    assert (found["n"], found[f"n {SAC}"], found[f"r_task {SAC}"]) == (2, 1, 7.0)
    assert "| 7.0, 1.0 (n = 1) |" in preferences_markdown(rows)
    (whole,) = preferences(pd.DataFrame(pairs + made_up(SAC, range(4), (0.0,) * 4, 1.0))).to_dict("records")
    assert whole[f"n {SAC}"] == whole["n"] == 2
    assert "(n = " not in preferences_markdown(pd.DataFrame(pairs + made_up(SAC, range(4), (0.0,) * 4, 1.0)))


def test_a_pair_without_a_number_is_none() -> None:
    new, experts = made_up(NEW, range(2), (1.0, 2.0), 4.0), made_up(EXPERT, range(2), (5.0, np.nan), 2.0)
    (found,) = preferences(pd.DataFrame(new + experts)).to_dict("records")
    assert (found["n"], found[f"r_task {NEW}"]) == (1, 1.0)
    assert preferences(pd.DataFrame(new[:1] + experts[1:])).empty


def test_a_reward_of_another_cs_reward_is_refused(tmp_path: Path) -> None:
    study, at = write(tmp_path)
    run = of(study)[0]
    learned = pays_first_action(run.irl.members, "mt_csirl")
    save_learned_reward(
        LearnedReward(learned.network, "mt_csirl", "action_norm", "mapped", run.irl.members), tmp_path / run.irl.folder
    )
    with pytest.raises(UserError, match="action_norm"):
        rows_of(study, at, [run])


def test_a_missing_policy_names_its_file(tmp_path: Path) -> None:
    study, at = write(tmp_path)
    run = of(study)[0]
    (tmp_path / run.folder / "policy.safetensors").unlink()
    with pytest.raises(UserError, match=f"{run.folder}/policy.safetensors"):
        rows_of(study, at, [run])
