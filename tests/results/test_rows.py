import shutil
from functools import cache

import numpy as np
import pandas as pd
import pytest

from mtcsirl.errors import UserError
from mtcsirl.files import storage
from mtcsirl.results import rows as rows_module
from mtcsirl.results.rows import (
    curve_rows,
    evaluation_rows,
    last_rows,
    matrix,
    point_rows,
    score_rows,
    select,
)
from mtcsirl.settings import EvaluationSettings, Settings
from mtcsirl.study.design import design, variants
from tests.results.made_up import sign, write_demonstrations, write_run

SETTINGS = Settings(
    seeds=(0, 1, 2),
    irl_seeds=(0,),
    cs_rewards=("velocity",),
    methods=("mt_csirl",),
    single_target={"tasks": ("reach-wall",)},
    multi_target={"tasks": ("reach-wall",), "train_targets": (1,)},
    multi_task={"train_tasks": ("reach", "door-close"), "train_targets": (1,), "unseen_tasks": ("push-back",)},
)
STUDY = design(SETTINGS, "table_2")
SPEEDS = {"train_expert": 0.8, "train_sac": 0.3, "learn_reward": 0.7, "transfer": 0.75}


def means(agent):
    return {"velocity": SPEEDS[agent["stage"]]}


@cache
def at(folder, episodes=2):
    """The study with its results in ``folder``."""
    return SETTINGS.model_copy(update={"results": str(folder), "evaluation": EvaluationSettings(episodes=episodes)})


@pytest.fixture
def results(tmp_path):
    for run in STUDY:
        if run.stage in SPEEDS:
            write_run(run, at(tmp_path), means)
    for run in STUDY.demonstrations:
        write_demonstrations(run, at(tmp_path))
    return tmp_path


def velocity(rows, **key):
    return select(rows, metric="velocity", policy="stochastic", **key)


def test_every_agent_of_the_study_with_its_mean_over_episodes(results):
    rows = evaluation_rows(STUDY, at(results))
    assert set(rows["status"]) == {"ok"}
    agents = rows[rows["stage"] != "collect_demonstrations"].drop_duplicates(list(rows_module.KEY))
    members = sum(len(run.members) for run in STUDY.irl_runs)
    assert len(agents) == len(STUDY.experts) + len(STUDY.baselines) + members + len(STUDY.transfers)
    for stage, speed in SPEEDS.items():
        values = velocity(rows, stage=stage)
        assert values["value"].to_numpy() == pytest.approx(speed, abs=0.011)
        assert (values["episodes"] == 2).all()


def test_matrix_is_seeds_by_tasks_and_refuses_a_mixture(results):
    rows = evaluation_rows(STUDY, at(results))
    transfers = velocity(rows, stage="transfer")
    assert matrix(transfers).shape == (3, 1)
    with pytest.raises(ValueError, match="more than one row"):
        matrix(velocity(rows, stage=["transfer", "train_sac"]))


def test_missing_run_stops_the_full_load_with_the_way_out(results):
    folder = results / STUDY.transfers[1].folder
    shutil.rmtree(folder)
    with pytest.raises(UserError, match="this run is missing") as error:
        evaluation_rows(STUDY, at(results))
    assert str(error.value).startswith(str(folder))
    assert "\n" not in str(error.value)


def test_runs_of_other_settings_are_stale_and_never_averaged(results):
    """A changed key, or another scale's folder: refused, or marked where parts are asked for."""
    other = at(results).model_copy(update={"sac": SETTINGS.sac.model_copy(update={"discount": 0.9})})
    with pytest.raises(UserError, match=r"this run is stale \(sac.discount: 0.97 -> 0.9\)"):
        evaluation_rows(STUDY, other)
    rows = evaluation_rows(STUDY, other, partial=True)
    agents = rows[rows["stage"] != "collect_demonstrations"]
    assert set(agents["status"]) == {"stale"}
    assert rows["value"].isna().all()
    assert agents["lacks"].str.contains("0.97 -> 0.9|another").all()
    assert curve_rows(STUDY, other, partial=True).empty
    own = next(iter(STUDY.transfers))
    sign(own, other)
    again = velocity(evaluation_rows(STUDY, at(results), partial=True), stage="transfer")
    assert again["status"].tolist() == ["stale", "ok", "ok"], "and the other way round"


def test_missing_run_stays_in_the_partial_frame(results):
    shutil.rmtree(results / STUDY.transfers[1].folder)
    rows = velocity(evaluation_rows(STUDY, at(results), partial=True), stage="transfer")
    assert rows["status"].tolist() == ["ok", "missing", "ok"]
    assert rows["value"].isna().tolist() == [False, True, False]


def test_nothing_there_yet_is_a_frame_of_missing_runs(tmp_path):
    rows = evaluation_rows(STUDY, at(tmp_path), partial=True)
    assert set(rows["status"]) == {"missing"}
    assert rows["value"].isna().all()
    for load in (curve_rows, score_rows, point_rows):
        assert load(design(SETTINGS), at(tmp_path), partial=True).empty
        with pytest.raises(UserError, match="is missing"):
            load(design(SETTINGS), at(tmp_path))


def test_generators_of_an_ablation_carry_its_name(tmp_path):
    """They have the keys of the main study's generators, which they must not be taken for."""
    study = variants(SETTINGS, "ablation_curriculum")["constant"]
    for run in study.irl_runs:
        write_run(run, at(tmp_path), means)
    rows = select(evaluation_rows(study, at(tmp_path), partial=True), stage="learn_reward")
    assert set(rows["status"]) == {"ok"}
    assert set(rows["experiment"]) == {"ablation_curriculum/constant"}
    assert set(rows["task"]) == set(SETTINGS.ablations.tasks)


def test_agent_below_its_gate_counts_and_is_marked(results):
    write_run(STUDY.experts[0], at(results), means, passed=False)
    rows = velocity(evaluation_rows(STUDY, at(results)), stage="train_expert", task=STUDY.experts[0].task)
    assert (rows["status"] == "below gate").sum() == 1
    assert rows["value"].notna().all()


def test_demonstrations_stand_beside_their_expert_with_their_own_gate(results):
    rows = select(evaluation_rows(STUDY, at(results)), stage="collect_demonstrations")
    assert len(rows) == 2 * len(STUDY.demonstrations)
    assert set(rows["status"]) == {"ok"}
    assert set(rows["seed"]) == set(SETTINGS.irl_seeds)
    write_demonstrations(STUDY.demonstrations[0], at(results), passed=False)
    rows = select(
        evaluation_rows(STUDY, at(results)), stage="collect_demonstrations", task=STUDY.demonstrations[0].task
    )
    assert set(rows["status"]) == {"below gate"}
    assert select(rows, metric="success")["value"].tolist() == [0.6]
    (results / STUDY.demonstrations[0].folder / "gate.json").unlink()
    with pytest.raises(UserError, match="is missing"):
        evaluation_rows(STUDY, at(results))
    rows = select(evaluation_rows(STUDY, at(results), partial=True), stage="collect_demonstrations")
    assert (rows["status"] == "missing").sum() == 2


def test_copied_seed_is_flagged_and_not_averaged(results):
    """A copy that still names seed 0, and one that was relabelled."""
    first, second, third = (run for run in STUDY.transfers if run.task == "push-back")
    shutil.copytree(results / first.folder, results / second.folder, dirs_exist_ok=True)
    episodes = storage.read_csv(results / first.folder / "evaluation.csv")
    storage.write_csv(results / third.folder / "evaluation.csv", episodes.assign(seed=third.seed))
    for run in (second, third):
        sign(run, at(results))
    rows = velocity(evaluation_rows(STUDY, at(results)), stage="transfer")
    assert rows["status"].tolist() == ["ok", "foreign", "duplicated"]
    assert rows["value"].isna().tolist() == [False, True, True]


def test_episode_twice_is_flagged(results):
    path = results / STUDY.baselines[0].folder / "evaluation.csv"
    episodes = storage.read_csv(path)
    storage.write_csv(path, pd.concat([episodes, episodes]))
    sign(STUDY.baselines[0], at(results))
    rows = velocity(evaluation_rows(STUDY, at(results)), stage="train_sac", seed=STUDY.baselines[0].seed)
    assert rows["status"].tolist() == ["duplicated"]
    assert np.isnan(rows["value"]).all()


def change(results, run, alter):
    """Rewrite an agent's evaluation; ``alter`` takes the frame and the mask of its stochastic velocities."""
    path = results / run.folder / "evaluation.csv"
    frame = storage.read_csv(path)
    mask = (frame["policy"] == "stochastic") & (frame["metric"] == "velocity")
    storage.write_csv(path, alter(frame, mask))
    sign(run, at(results))


@pytest.mark.parametrize(
    ("alter", "lacks"),
    [
        (lambda f, m: f.assign(value=f["value"].mask(m & (f["episode"] == 1))),
         "stochastic velocity: episode 1 has no number"),
        (lambda f, m: f.assign(value=f["value"].mask(m & (f["episode"] == 1), np.inf)),
         "stochastic velocity: episode 1 has no number"),
        (lambda f, m: f.assign(value=np.nan), "no number"),
        (lambda f, m: f[~(m & (f["episode"] == 0))], "stochastic velocity: 1 of 2 episodes"),
        (lambda f, m: f[f["policy"] != "deterministic"], "deterministic .*: 0 of 2 episodes"),
        (lambda f, m: f[f["metric"] != "velocity_distance"], "velocity_distance: 0 of 2 episodes"),
        (lambda f, m: f[f["metric"] != "diverged"], "diverged: 0 of 2 episodes"),
        (lambda f, m: f.assign(kept="last"), "0 of 2 episodes"),
        (lambda f, m: pd.concat([f, f[m].assign(episode=[2, 3])]), "stochastic velocity: 4 of 2 episodes"),
        (lambda f, m: f.iloc[:0], "0 of 2 episodes"),
    ],
)  # fmt: skip
def test_incomplete_evaluation_is_marked_and_nothing_averaged_over_the_rest(results, alter, lacks):
    run = STUDY.baselines[0]
    change(results, run, alter)
    rows = select(evaluation_rows(STUDY, at(results)), stage="train_sac", task=run.task)
    own, others = rows[rows["seed"] == run.seed], rows[rows["seed"] != run.seed]
    assert set(own["status"]) == {"incomplete"}
    assert own["value"].isna().all()
    assert own["lacks"].str.contains(lacks).all()
    assert set(others["status"]) == {"ok"}
    assert others["value"].notna().all()
    assert set(others["lacks"]) == {""}


def test_episodes_are_those_that_the_settings_ask_for(results):
    assert set(evaluation_rows(STUDY, at(results))["status"]) == {"ok"}
    for run in STUDY:
        sign(run, at(results, 10))
    rows = evaluation_rows(STUDY, at(results, 10))
    assert set(rows.loc[rows["stage"] != "collect_demonstrations", "status"]) == {"incomplete"}
    assert "2 of 10 episodes" in rows["lacks"].iloc[0]


def test_without_its_gate_a_run_is_incomplete(results):
    (results / STUDY.experts[0].folder / "gate.json").unlink()
    sign(STUDY.experts[0], at(results))
    rows = velocity(evaluation_rows(STUDY, at(results)), stage="train_expert", task=STUDY.experts[0].task)
    assert (rows["status"] == "incomplete").sum() == 1
    assert "gate.json" in set(rows["lacks"])
    storage.write_json(results / STUDY.experts[0].folder / "gate.json", {"hello": 1})
    sign(STUDY.experts[0], at(results))
    with pytest.raises(UserError, match=r"gate\.json: not the verdict of a gate"):
        evaluation_rows(STUDY, at(results))


FINE = {"passed": True, "success": 1.0, "metric": 0.75}
NO_GATES = {
    "a list": [],
    "passed as text": FINE | {"passed": "false"},
    "passed as number": FINE | {"passed": 1},
    "passed as null": FINE | {"passed": None},
    "success as text": FINE | {"success": "all"},
    "no metric": {"passed": True, "success": 1.0},
    "diverged as text": FINE | {"diverged": "none"},
    "members as text": FINE | {"members": "ab"},
    "members as null": FINE | {"members": None},
    "a member that is a text": FINE | {"members": ["a"]},
    "a member whose passed is a text": FINE | {"members": [FINE | {"task": "reach", "target": 1, "passed": "false"}]},
}


@pytest.mark.parametrize("run", [STUDY.experts[0], STUDY.demonstrations[0]], ids=lambda run: run.stage)
@pytest.mark.parametrize("what", NO_GATES)
def test_what_is_no_verdict_of_a_gate_is_one_line(results, what, run):
    storage.write_json(results / run.folder / "gate.json", NO_GATES[what])
    sign(run, at(results))
    with pytest.raises(UserError, match=r"gate\.json: not the verdict of a gate; delete it") as error:
        evaluation_rows(STUDY, at(results), partial=True)
    assert "\n" not in str(error.value)


def test_a_member_of_a_gate_is_found_by_task_and_target(results):
    """The run's own word counts for an agent that no member speaks of."""
    run = STUDY.experts[0]
    own = {"task": run.task, "target": run.target}
    for members, status in (
        ([FINE | own | {"passed": False}], "below gate"),
        ([FINE | own, FINE | own | {"target": [1], "passed": False}], "ok"),
        ([FINE | {"task": "other", "passed": False}], "ok"),
    ):
        storage.write_json(results / run.folder / "gate.json", FINE | {"members": members})
        sign(run, at(results))
        rows = select(evaluation_rows(STUDY, at(results)), stage="train_expert", task=run.task, seed=run.seed)
        assert set(rows["status"]) == {status}, members


@pytest.mark.parametrize(("column", "text"), [("value", "abc"), ("episode", "first"), ("seed", "zero")])
def test_text_in_a_column_of_numbers_is_one_line(results, column, text):
    run = STUDY.baselines[0]
    change(
        results,
        run,
        lambda frame, mask: frame.astype({column: object}).assign(
            **{column: frame[column].astype(object).where(~mask, text)}
        ),
    )
    with pytest.raises(UserError, match=rf"evaluation\.csv: column {column} holds '{text}', not a number") as error:
        evaluation_rows(STUDY, at(results))
    assert "\n" not in str(error.value)


def test_diverged_episodes_are_counted(results):
    run = STUDY.baselines[0]
    change(results, run, lambda f, m: f.assign(
        value=f["value"].mask((f["metric"] == "diverged") & (f["policy"] == "stochastic") & (f["episode"] == 1), 1.0)
    ))  # fmt: skip
    rows = select(evaluation_rows(STUDY, at(results)), stage="train_sac", task=run.task)
    assert set(rows["status"]) == {"ok"}
    counted = rows[rows["diverged"] == 1]
    assert set(zip(counted["seed"], counted["policy"], strict=True)) == {(run.seed, "stochastic")}
    assert set(counted["metric"]) == {"success", "velocity", "action_norm", "velocity_distance",
                                      "action_norm_distance", "task_reward"}  # fmt: skip


def test_the_last_policy_is_read_beside_the_kept_one_and_never_for_it(results):
    run = STUDY.baselines[0]
    kept = evaluation_rows(STUDY, at(results))
    change(results, run, lambda f, m: pd.concat([f, f.assign(kept="last", value=f["value"].mask(m, 0.11))]))
    pd.testing.assert_frame_equal(evaluation_rows(STUDY, at(results)), kept)
    last = last_rows(STUDY, at(results))
    assert set(last["stage"]) == {"train_expert", "train_sac"}
    own = velocity(last, stage="train_sac", task=run.task, seed=run.seed)
    assert (own["value"].tolist(), own["status"].tolist(), own["kept"].tolist()) == ([0.11], ["ok"], ["last"])
    others = last[(last["stage"] == "train_expert") | (last["seed"] != run.seed)]
    assert set(others["status"]) == {"incomplete"}, "these runs have no rows of a last policy"


def test_distances_are_rows_too(results):
    rows = select(evaluation_rows(STUDY, at(results)), stage="train_sac", policy="stochastic")
    assert select(rows, metric="velocity_distance")["value"].to_numpy() == pytest.approx(0.5, abs=0.02)


def test_demonstrations_without_a_metric_have_none(results):
    run = STUDY.demonstrations[0]
    gate = {"gate": "expert", "passed": False, "success": 1.0, "metric": None, "diverged": 2}
    storage.write_json(results / run.folder / "gate.json", gate)
    sign(run, at(results))
    rows = select(evaluation_rows(STUDY, at(results)), stage="collect_demonstrations", task=run.task)
    assert select(rows, metric="velocity")["value"].isna().all()
    assert set(rows["diverged"]) == {2}


def test_truncated_file_is_one_line(results):
    path = results / STUDY.baselines[0].folder / "evaluation.csv"
    storage.write_text(path, "task,target\n1,2,3,4\n")
    sign(STUDY.baselines[0], at(results))
    with pytest.raises(UserError, match=r"evaluation\.csv"):
        evaluation_rows(STUDY, at(results))


def test_curves_carry_the_key_of_their_agent(results):
    curves = curve_rows(STUDY, at(results))
    generators = select(curves, stage="learn_reward")
    assert set(generators["task"]) == {"reach", "door-close"}
    assert len(generators) == 2 * len(STUDY.irl_runs[0].members)
    assert set(select(curves, stage="transfer")["source"]) == {"all"}


def test_scores_and_points_carry_the_key_of_their_reward(tmp_path):
    study = design(SETTINGS)
    for run in study.scores:
        score = {
            "transitions": "sac",
            "reward": "learned",
            "statistic": "pearson",
            "value": 0.5,
            "low": 0.4,
            "high": 0.6,
        }
        storage.write_csv(tmp_path / run.folder / "scores.csv", pd.DataFrame([score | {"n": 10}]))
        point = {"transitions": "sac", "agent": 0, "episode": 0, "truth": -0.1, "learned": 0.2, "task_reward": 9.0}
        point |= {"random": 0.0}
        storage.write_parquet(tmp_path / run.folder / "points.parquet", pd.DataFrame([point]))
        sign(run, at(tmp_path))
    scores, points = score_rows(study, at(tmp_path)), point_rows(study, at(tmp_path))
    assert len(scores) == len(points) == len(study.scores)
    assert {"reach-wall", "push-back"} == set(scores["task"])
    assert {"single_target", "multi_task"} == set(points["experiment"])
