"""Agents of a study in lockstep: what Snakemake would make, once, and shared between processes."""

import dataclasses

import pytest

from mtcsirl.agents.finite import NotFiniteError
from mtcsirl.episodes.policy import load_policy
from mtcsirl.files.identity import FILE
from mtcsirl.files.storage import locked, read_json
from mtcsirl.settings.loading import load
from mtcsirl.stages import together
from mtcsirl.stages.agents import agent_task, train
from mtcsirl.stages.collect_demonstrations import collect_demonstrations
from mtcsirl.stages.learn_reward import Learning, learn_reward
from mtcsirl.stages.together import job_of, train_together
from mtcsirl.study.design import design
from mtcsirl.study.outputs import OUTPUTS


@pytest.fixture
def settings(tmp_path):
    return load(scale="smoke", overrides=[f"results={tmp_path}"])


def test_an_agent_is_trained_once_its_reward_is_there(settings, tmp_path):
    study = design(settings, "figure_2")
    transfer = next(run for run in study.transfers if run.irl.cs_reward == "velocity")
    lines: list[str] = []
    agents = len(study.experts) + len(study.baselines)
    assert train_together(study.agents, settings, tmp_path, log=lines.append) == agents, "no reward yet"
    assert train_together(study.agents, settings, tmp_path, log=lines.append) == 0, "what is there is not trained again"
    (demonstrations,) = (run for run in study.demonstrations if run.cs_reward == "velocity")
    collect_demonstrations(
        demonstrations.settings(settings),
        demonstrations,
        tmp_path / demonstrations.expert.folder,
        tmp_path / demonstrations.folder,
    )
    files = [tmp_path / demonstrations.folder / "demonstrations.parquet"]
    learning = Learning("single_target", "mt_csirl", "velocity", transfer.irl.source, 0)
    learn_reward(transfer.irl.settings(settings), learning, files, tmp_path / transfer.irl.folder)
    assert train_together(study.agents, settings, tmp_path, log=lines.append) == 1
    assert any(line.startswith("transfer: ") for line in lines)
    for run in (*study.experts, *study.baselines, transfer):
        assert {name for name in OUTPUTS[run.stage] if (tmp_path / run.folder / name).is_file()} == set(
            OUTPUTS[run.stage]
        )
        assert read_json(tmp_path / run.folder / "settings.json") == run.settings(settings).model_dump(mode="json")
        load_policy(tmp_path / run.folder)
        assert not list((tmp_path / run.folder).glob("*checkpoint*")), "no checkpoint is left behind"
    inputs = read_json(tmp_path / transfer.folder / "provenance.json")["inputs"]
    assert set(inputs) == {"reward.safetensors", "reward.json"}


def test_agents_that_another_process_holds_are_left_to_it(settings, tmp_path):
    runs = [run for run in design(settings) if run.stage == "train_sac"]
    with locked(tmp_path / runs[0].folder):
        assert train_together(runs[:2], settings, tmp_path, log=lambda line: None) == 1
    assert not (tmp_path / runs[0].folder / "gate.json").exists()
    assert (tmp_path / runs[1].folder / "gate.json").exists()


def test_a_batch_leaves_what_single_jobs_leave(settings, tmp_path):
    runs = [run for run in design(settings) if run.stage in ("train_sac", "train_expert")][:3]
    assert train_together(runs, settings, tmp_path / "together", log=lambda line: None) == len(runs)
    for run in runs:
        job, about, inputs = job_of(run, settings, tmp_path)
        train(job, agent_task(run.stage, about, job, tmp_path / "alone" / run.folder, None, inputs))
        for name in (*OUTPUTS[run.stage], FILE):
            if name != "provenance.json":
                pair = [(tmp_path / side / run.folder / name).read_bytes() for side in ("together", "alone")]
                assert pair[0] == pair[1], (run.folder, name)


def test_an_agent_that_leaves_the_finite_numbers_takes_no_other_with_it(settings, tmp_path, monkeypatch):
    runs = [run for run in design(settings) if run.stage == "train_sac"][:3]
    original = together.job_of

    def broken(run, *arguments):
        job, *others = original(run, *arguments)
        sac = job.settings.sac.model_copy(update={"reward_scale": 1e38})
        bad = dataclasses.replace(job, settings=job.settings.model_copy(update={"sac": sac}))
        return (bad if run == runs[1] else job), *others

    monkeypatch.setattr(together, "job_of", broken)
    lines: list[str] = []
    with pytest.raises(NotFiniteError, match=runs[1].task):
        train_together(runs, settings, tmp_path, log=lines.append)
    assert [(tmp_path / run.folder / "gate.json").is_file() for run in runs] == [True, False, True]
    assert not (tmp_path / runs[1].folder / "policy.safetensors").exists()


def test_batches_hold_no_more_than_asked(settings, tmp_path):
    runs = [run for run in design(settings) if run.stage == "train_sac"][:3]
    lines: list[str] = []
    assert train_together(runs, settings, tmp_path, most=2, log=lines.append) == 3
    assert [line.count("sac/") for line in lines if line.startswith("train_sac")] == [2, 1]


def test_jobs_are_those_of_the_stages(tmp_path):
    settings = load()
    study = design(settings)
    baseline, expert = study.baselines[0], next(run for run in study.experts if run.task == "plate-slide")
    (sac, _, _), (other, _, _) = job_of(baseline, settings, tmp_path), job_of(expert, settings, tmp_path)
    assert (sac.gate, other.gate) == ("sac", "expert")
    assert other.settings == expert.settings(settings)
    assert other.settings.cs_weight == 40.0


def test_variants_of_an_ablation_train_apart(settings, tmp_path):
    lines: list[str] = []
    study = design(settings, "ablation_observation")
    assert train_together(study.agents, settings, tmp_path, log=lines.append) == len(study.experts)
    batches = [line for line in lines if line.startswith("train_expert")]
    assert [line.count("/raw/") for line in batches] == [0, len(study.experts) // 2]


def test_only_agents_with_the_same_warm_up_share_a_batch(tmp_path):
    settings = load(scale="smoke", overrides=[f"results={tmp_path}", "expert.warm_up_steps={push-back: 200}"])
    runs = [run for run in design(settings).experts if run.task in ("reach-wall", "drawer-close", "push-back")]
    lines: list[str] = []
    assert train_together(runs, settings, tmp_path, log=lines.append) == len(runs)
    batches = [line for line in lines if line.startswith("train_expert")]
    assert sorted(("push-back" in line, "reach-wall" in line) for line in batches) == [(False, True), (True, False)]
