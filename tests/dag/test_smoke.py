"""The whole DAG at smoke scale: what it leaves behind, checked file by file."""

import json
import shutil
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import torch

from mtcsirl import cli
from mtcsirl.episodes.policy import load_policy
from mtcsirl.files import storage
from mtcsirl.results.preference import BEHAVIOURS
from mtcsirl.rewards.learned import load_learned_reward
from mtcsirl.settings import Settings
from mtcsirl.study.design import ARTEFACTS, design
from mtcsirl.study.outputs import OUTPUTS
from mtcsirl.study.plan import request, scored_sizes
from mtcsirl.study.rates import load_rates
from mtcsirl.study.runs import Baseline, Expert, IrlRun, Runs, Transfer
from mtcsirl.study.status import DONE, study_status
from tests.dag.conftest import SMOKE, Snakemake

pytestmark = pytest.mark.dag
NOTE = "smoke scale: numbers mean nothing"
METRICS = {
    "success": (0, 1), "velocity": (0, 2), "action_norm": (0, 4), "velocity_distance": (0, 2),
    "action_norm_distance": (0, 3), "task_reward": (0, 10), "diverged": (0, 1),
}  # fmt: skip
Agent = Expert | Baseline | Transfer | IrlRun


@pytest.fixture(scope="module")
def study(smoke_settings: Settings) -> Runs:
    return design(smoke_settings)


@pytest.fixture(scope="module")
def results(smoke: Path, smoke_settings: Settings) -> Path:
    return smoke / smoke_settings.results


@pytest.fixture(scope="module")
def figures(smoke: Path, smoke_settings: Settings) -> Path:
    return smoke / smoke_settings.figures


def agents(study: Runs) -> list[Agent]:
    return [run for run in study if isinstance(run, Agent)]


def test_every_run_left_every_file(results: Path, study: Runs) -> None:
    for run in study:
        for name in OUTPUTS[run.stage]:
            assert (results / run.folder / name).stat().st_size > 0, f"{run.folder}/{name}"


def test_nothing_unfinished_is_left(results: Path, smoke: Path) -> None:
    leftovers = [path for pattern in ("*.tmp", ".lock", "checkpoint*") for path in results.rglob(pattern)]
    assert leftovers == []
    assert not list((smoke / "paper_figs").rglob("*.tmp"))


def test_settings_are_the_slice_of_the_study(results: Path, study: Runs, smoke_settings: Settings) -> None:
    for run in study:
        written = storage.read_json(results / run.folder / "settings.json")
        assert written == run.settings(smoke_settings).model_dump(mode="json")


def test_provenance_names_commit_versions_machine_and_cost(
    results: Path, study: Runs, smoke_settings: Settings
) -> None:
    rates = load_rates()
    for run in study:
        found = storage.read_json(results / run.folder / "provenance.json")
        assert {"commit", "versions", "machine", "cost", "inputs"} <= set(found)
        assert {"metaworld", "mujoco", "torch", "numpy"} <= set(found["versions"])
        assert found["cost"]["wall_seconds"] > 0
        asked = request(run, smoke_settings, rates).mem_mb * 1e6 / 2**20
        assert 0 < found["cost"]["peak_memory_mib"] < asked, f"the memory that its rule asks for: {run.folder}"


def test_inputs_are_traced_to_their_bytes(results: Path, study: Runs) -> None:
    for run in study.demonstrations:
        inputs = storage.read_json(results / run.folder / "provenance.json")["inputs"]
        assert storage.checksum(results / run.expert.folder / "policy.safetensors") in inputs.values()
    for run in study.transfers:
        inputs = storage.read_json(results / run.folder / "provenance.json")["inputs"]
        assert storage.checksum(results / run.irl.folder / "reward.safetensors") in inputs.values()


def test_evaluation_has_one_row_per_policy_episode_and_metric(
    results: Path, study: Runs, smoke_settings: Settings
) -> None:
    episodes = smoke_settings.evaluation.episodes
    for run in agents(study):
        frame = pd.read_csv(results / run.folder / "evaluation.csv", keep_default_na=False)
        key = ["task", "target", "cs_reward", "seed", "policy", "kept"]
        assert list(frame.columns) == [*key, "episode", "metric", "value"]
        frame = frame[frame["kept"] == "kept"]
        members = run.members if isinstance(run, IrlRun) else ((run.task, run.target),)
        assert set(zip(frame["task"], frame["target"], strict=True)) == set(members)
        assert set(frame["policy"]) == {"stochastic", "deterministic"}
        assert set(frame["metric"]) == set(METRICS)
        assert len(frame) == len(members) * 2 * episodes * len(METRICS)
        assert not frame.duplicated(["task", "target", "policy", "episode", "metric"]).any()
        assert set(frame["seed"]) == {run.seed}
        for metric, (low, high) in METRICS.items():
            values = frame.loc[frame["metric"] == metric, "value"].astype(float)
            assert values.between(low, high).all()
        successes = frame.loc[frame["metric"] == "success", "value"].astype(float)
        assert set(successes) <= {0.0, 1.0}


def test_the_baseline_has_no_cs_reward(results: Path, study: Runs) -> None:
    for run in study.baselines:
        frame = pd.read_csv(results / run.folder / "evaluation.csv", keep_default_na=False)
        assert set(frame["cs_reward"]) == {""}


def test_gates_say_what_was_asked_and_what_was_reached(results: Path, study: Runs) -> None:
    gates = {
        "train_expert": "expert", "train_sac": "sac", "collect_demonstrations": "expert",
        "learn_reward": "generator", "transfer": "sac",
    }  # fmt: skip
    for run in [*agents(study), *study.demonstrations]:
        gate = storage.read_json(results / run.folder / "gate.json")
        assert gate["gate"] == gates[run.stage]
        assert isinstance(gate["passed"], bool)
        assert 0 <= gate["success"] <= 1
        assert gate["limits"]["success"] == 0.9


def test_curves_are_tidy(results: Path, study: Runs, smoke_settings: Settings) -> None:
    for run in agents(study):
        curve = pd.read_csv(results / run.folder / "curve.csv")
        own = ["task", "target"] if isinstance(run, IrlRun) else []
        assert list(curve.columns) == [*own, "step", "metric", "value"]
        assert {"success", "velocity", "action_norm", "task_reward"} <= set(curve["metric"])
        assert (curve["step"] > 0).all()
        if not isinstance(run, IrlRun):
            assert curve["step"].max() <= run.settings(smoke_settings).steps  # type: ignore[attr-defined]


def test_policies_act(results: Path, study: Runs) -> None:
    for run in (*study.experts, *study.baselines, *study.transfers):
        action = load_policy(results / run.folder).act(np.zeros(39, np.float32))
        assert action.shape == (4,)
        assert (np.abs(action) <= 1).all()


def test_each_generator_is_stored(results: Path, study: Runs) -> None:
    for run in study.irl_runs:
        stored = {path.name for path in (results / run.folder / "policies").iterdir()}
        for task, target in run.members:
            assert {f"{task}-t{target}.safetensors", f"{task}-t{target}.json"} <= stored


def test_learned_rewards_load_and_differ_by_method(results: Path, study: Runs) -> None:
    weights = {}
    for run in study.irl_runs:
        load_learned_reward(results / run.folder)
        tensors = storage.read_tensors(results / run.folder / "reward.safetensors")
        assert all(torch.isfinite(tensor).all() for tensor in tensors.values())
        weights[run.folder] = storage.checksum(results / run.folder / "reward.safetensors")
    # the ablation's constant curriculum is that of a task on which generators are good from the start
    own = [value for folder, value in weights.items() if folder.startswith("irl/")]
    assert len(set(own)) == len(own)


def test_demonstrations_are_the_experts_episodes(results: Path, study: Runs, smoke_settings: Settings) -> None:
    for run in study.demonstrations:
        frame = storage.read_parquet(results / run.folder / "demonstrations.parquet")
        own = run.settings(smoke_settings)
        assert len(frame) == own.episodes * own.episode_steps  # type: ignore[attr-defined]
        assert set(frame["task"]) == {run.task}
        assert set(frame["target"]) == {run.target}
        assert frame["task_reward"].between(0, 10).all()
        assert frame["step"].max() == own.episode_steps - 1  # type: ignore[attr-defined]


def test_scores_name_transitions_controls_and_statistics(results: Path, study: Runs, smoke_settings: Settings) -> None:
    for run in study.scores:
        scores = pd.read_csv(results / run.folder / "scores.csv")
        assert {"expert", "sac", "generator", "uniform"} <= set(scores["transitions"])
        assert {"learned", "zero", "random"} <= set(scores["reward"])
        assert {"pearson", "spearman"} <= set(scores["statistic"])
        assert scores["value"].dropna().between(-1.0001, 1.0001).all()
        of_learned = scores[(scores["reward"] == "learned") & (scores["statistic"] == "pearson")]
        _, sizes = scored_sizes(run, run.settings(smoke_settings).score.transitions, smoke_settings)
        assert of_learned.groupby("transitions", sort=False)["n"].sum().tolist() == sizes, "as planned"
        points = storage.read_parquet(results / run.folder / "points.parquet")
        assert {"transitions", "episode", "truth", "learned", "task_reward"} <= set(points.columns)


@pytest.mark.parametrize("number", range(1, 6))
def test_tables_exist_in_three_forms_and_say_the_scale(results: Path, number: int) -> None:
    table = results / f"tables/table_{number}"
    assert NOTE in table.with_suffix(".md").read_text()
    latex = table.with_suffix(".tex").read_text()
    assert NOTE in latex
    assert r"\toprule" in latex
    frame = pd.read_csv(table.with_suffix(".csv"))
    assert len(frame) > 0
    assert set(frame["scale"]) == {"smoke"}


@pytest.mark.parametrize("figure", [name for name in ARTEFACTS if name.startswith("figure_")])
def test_figures_exist_as_pdf_and_png(figures: Path, figure: str) -> None:
    pdf, png = (figures / f"{figure}.{ending}" for ending in ("pdf", "png"))
    assert pdf.read_bytes().startswith(b"%PDF")
    assert png.read_bytes().startswith(b"\x89PNG")
    assert png.stat().st_size > 5_000, "more than an empty page"


def test_no_claim_is_judged_on_smoke(results: Path) -> None:
    claims = json.loads((results / "claims/claims.json").read_text())["claims"]
    assert [claim["name"] for claim in claims] == [f"C{number}" for number in range(1, 14)]
    assert {claim["verdict"] for claim in claims} <= {"inconclusive", "precondition not met", "not run"}
    assert NOTE in (results / "claims/claims.md").read_text()


def test_the_report_shows_every_artefact(results: Path) -> None:
    page = (results / "report/index.html").read_text()
    assert NOTE in page
    for name in ARTEFACTS:
        assert name in page
    assert "http://" not in page.replace("http://www.w3.org", "")


def test_status_of_a_finished_study(
    smoke: Path, smoke_settings: Settings, study: Runs, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(smoke)
    assert {status.state for status in study_status(study, smoke_settings)} == {DONE}


def test_the_same_seed_gives_the_same_bytes(results: Path, study: Runs, smoke: Path, tmp_path: Path) -> None:
    """The verb alone, outside the DAG, against what the DAG made."""
    run = study.experts[0]
    settings = (results / run.folder / "settings.json").read_text()
    key = ["--task", run.task, "--target", str(run.target), "--cs-reward", run.cs_reward, "--seed", str(run.seed)]
    assert cli.main(["train-expert", *key, "--settings", settings, "--output", str(tmp_path)]) == 0
    for name in OUTPUTS[run.stage]:
        if name != "provenance.json":
            assert (tmp_path / name).read_bytes() == (results / run.folder / name).read_bytes(), name


def test_a_table_of_partial_results_marks_what_is_missing(
    results: Path, study: Runs, smoke_settings: Settings, tmp_path: Path
) -> None:
    lost = study.baselines[0].folder if study.baselines[0].task == "reach-wall" else "sac/reach-wall-t0/s0"
    copy = tmp_path / "results"
    shutil.copytree(results, copy, ignore=shutil.ignore_patterns("*.safetensors", "*.parquet", "logs"))
    shutil.rmtree(copy / lost)
    settings = smoke_settings.model_copy(update={"results": str(copy)}).model_dump_json()
    assert cli.main(["table", "2", "--settings", settings, "--output", str(tmp_path)]) == 2
    assert cli.main(["table", "2", "--partial", "--settings", settings, "--output", str(tmp_path)]) == 0
    assert "missing" in (tmp_path / "table_2.md").read_text().lower()


def test_every_irl_run_is_drawn_and_diagnosed(
    smoke: Path, snakemake: Snakemake, results: Path, figures: Path, study: Runs
) -> None:
    done = snakemake("--cores", "2", "diagnostics", *SMOKE)
    assert done.returncode == 0, done.stderr[-3000:]
    for run in study.irl_runs:
        assert (figures / "diagnostics" / run.folder).with_suffix(".png").stat().st_size > 20_000, run.folder
    rows = pd.read_csv(results / "diagnostics/diagnostics.csv")
    per_run = rows.groupby(["experiment", "method", "cs_reward", "source", "seed"]).size()
    assert len(per_run) == len(study.irl_runs)
    for run in study.irl_runs:
        discriminators = 2 if run.method == "mt_csirl_lt" else 1
        found = per_run[(run.experiment, run.method, run.cs_reward, run.source, run.seed)]
        assert found == discriminators * len(run.members)
    assert NOTE in (results / "diagnostics/diagnostics.md").read_text()


def test_every_new_agent_is_held_against_its_expert(
    smoke: Path, snakemake: Snakemake, results: Path, study: Runs
) -> None:
    done = snakemake("--cores", "2", "reward_preference", *SMOKE)
    assert done.returncode == 0, done.stderr[-3000:]
    rows = pd.read_csv(results / "reward_preference/reward_preference.csv")
    assert rows["behaviour"].value_counts().to_dict() == dict.fromkeys(BEHAVIOURS, len(study.transfers))
    assert rows[["r_task", "f", "paid", "paid_from_start"]].notna().all(axis=None)
    assert NOTE in (results / "reward_preference/reward_preference.md").read_text()


def test_snakemakes_own_report(smoke: Path, snakemake: Snakemake, tmp_path: Path) -> None:
    done = snakemake("all", *SMOKE, "--report", str(tmp_path / "report.zip"))
    assert done.returncode == 0, done.stderr[-3000:]
    assert (tmp_path / "report.zip").stat().st_size > 100_000
