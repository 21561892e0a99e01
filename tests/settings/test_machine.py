"""What this machine cannot do is said before a job, and a scale promises what it says."""

from pathlib import Path

import pytest
import torch

from mtcsirl import cli
from mtcsirl.agents.sac import FusedSac
from mtcsirl.errors import UserError
from mtcsirl.names import EXPERIMENTS
from mtcsirl.settings import SacSettings
from mtcsirl.settings.loading import configured, load
from mtcsirl.settings.machine import _learners, check_agent, check_irl, check_run, check_study
from mtcsirl.settings.runs import baseline_run, demonstration_run, irl_run, score_run

HUGE = "[1000000, 1000000]"


@pytest.mark.skipif(torch.cuda.is_available(), reason="this machine has a CUDA device")
@pytest.mark.parametrize("device", ["cuda", "cuda:3"])
def test_a_device_that_is_not_there_is_one_line(
    device: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    says = f"configuration: sac.device = {device!r}: this machine has no CUDA device; set it to cpu"
    with pytest.raises(UserError, match=says):
        check_study(load(overrides=[f"sac.device={device}"]))
    key = ["--task", "reach", "--seed", "0", "--output", str(tmp_path / "run")]
    assert cli.main(["train-sac", *key, "--set", f"sac.device={device}"]) == 2
    assert says in capsys.readouterr().err
    assert not (tmp_path / "run").exists()
    assert load(overrides=[f"sac.device={device}"]), "the machine that plans need not be the one that trains"


@pytest.mark.parametrize(
    ("change", "names"),
    [
        (f"sac.hidden_sizes={HUGE}", "sac.hidden_sizes"),
        ("expert.steps={default: 1000000000000}", "expert.steps"),
        ("transfer.steps={default: 1000000000000}", "transfer.steps"),
        ("sac.critics=1000000", "sac.critics"),
        ("sac.minibatch=1000000000000", "sac.minibatch"),
        (f"sac.minibatch=1{'0' * 400}", "sac.minibatch"),
        ("expert.curriculum_window=1000000000000", "expert.curriculum_window"),
        ("irl.discriminator.minibatch=1000000000000", "irl.discriminator.minibatch and irl.discriminator_updates"),
        ("irl.discriminator.bottleneck_size=1000000000000", "irl.discriminator.bottleneck_size"),
        ("irl.curriculum_window=1000000000000", "irl.curriculum_window"),
        ("score.transitions=1000000000000", "score.transitions"),
        *(
            (f"demonstrations.episodes={{{experiment}: 1000000000000}}", "demonstrations.episodes")
            for experiment in EXPERIMENTS
        ),
    ],
)
def test_what_does_not_fit_into_memory_is_named(change: str, names: str) -> None:
    with pytest.raises(
        UserError, match=rf"configuration: {names}: a run would need .* GiB of memory, this machine has"
    ):
        check_study(load(overrides=[change]))


@pytest.mark.parametrize(
    "change",
    [
        "sac.critics=100",
        "sac.minibatch=100000",
        "irl.discriminator.minibatch=10000",
        "score.transitions=1000000",
        "demonstrations.episodes.single_target=1000",
        "sac.updates_per_step=1000",
        "expert={curriculum: false, curriculum_window: 1000000000000}",
    ],
)
def test_what_is_large_and_possible_is_no_mistake(change: str) -> None:
    check_study(load(overrides=[change]))


def test_the_memory_of_an_agent_is_that_of_its_learner() -> None:
    """The formula against tensors: networks with their moments, and one minibatch in all layers."""
    sac = SacSettings(hidden_sizes=(24, 40), critics=3, minibatch=50)
    learner = FusedSac(1, sac, seeds=[0])
    stacks = (learner.actor, learner.critics, learner.target_critics)
    held = sum(stack.parameters.numel() for stack in stacks)
    held += sum(stack.gradient.numel() for stack in stacks[:2])
    held += sum(o.mean.numel() + o.square.numel() for name, o in learner._optimisers.items() if name != "temperature")
    needs = _learners(sac, 1)
    assert needs["sac.hidden_sizes"] + needs["sac.critics"] == pytest.approx(held, rel=0.01), "rows are aligned"
    assert needs["sac.hidden_sizes"] + needs["sac.critics"] <= held
    passes = learner.actor.workspace(2 * 50), learner.critics.workspace(50)
    layers = sum(tensor.numel() for one in passes for tensor in one.activations)
    assert needs["sac.minibatch"] == layers + 50 * (39 + 4 + 39 + 1)


def test_runs_are_held_against_the_memory_too() -> None:
    study = load(overrides=[f"irl.discriminator.hidden_sizes={HUGE}"])
    with pytest.raises(UserError, match=r"irl\.discriminator\.hidden_sizes: a run would need"):
        check_irl(irl_run(study, "single_target", ["reach"]), 1)
    memory = load(overrides=["irl.generator_memory=1000000000000", "irl.iterations=1000000000"])
    with pytest.raises(UserError, match=r"irl\.generator_memory: a run would need"):
        check_irl(irl_run(memory, "single_target", ["reach"]), 1)
    with pytest.raises(UserError, match="steps: a run would need"):
        check_agent(baseline_run(load(overrides=["baseline.steps={default: 1000000000000}"]), "reach"))
    with pytest.raises(UserError, match="configuration: demonstration_episodes: a run would need"):
        check_irl(irl_run(load(overrides=[f"demonstrations.episodes.multi_task={10**12}"]), "multi_task", ["reach"]), 1)
    with pytest.raises(UserError, match="configuration: episodes: a run would need"):
        check_run(demonstration_run(load(overrides=[f"demonstrations.episodes.multi_task={10**12}"]), "velocity"))
    with pytest.raises(UserError, match=r"score\.transitions: a run would need"):
        check_run(score_run(load(overrides=[f"score.transitions={10**12}"])))


def test_generators_add_up() -> None:
    run = irl_run(load(), "multi_task", ["reach"])
    check_run(run, 10)
    with pytest.raises(UserError, match=r"irl\.generator_memory: a run would need"):
        check_run(run, 1_000_000)


def test_a_job_that_cannot_be_is_refused_before_it_begins(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    key = ["--task", "reach", "--seed", "0", "--output", str(tmp_path / "run")]
    assert cli.main(["train-sac", *key, "--set", "sac.critics=1000000"]) == 2
    assert "sac.critics: a run would need" in capsys.readouterr().err
    assert not (tmp_path / "run").exists()


@pytest.mark.parametrize("scale", ["smoke", "desk", "paper"])
def test_every_scale_fits(scale: str) -> None:
    study = load(scale=scale)
    check_study(study)
    check_irl(irl_run(study, "multi_task", study.multi_task.train_tasks), 30)


def test_the_scale_paper_is_the_papers_numbers_or_refused() -> None:
    with pytest.raises(UserError, match=r"scale = 'paper', but environment\.observation = 'mapped'.*and \d+ more"):
        load(overrides=["scale=paper"])
    with pytest.raises(UserError, match=r"scale = 'paper', but sac\.discount = 0\.5, in the paper 0\.99;"):
        load(scale="paper", overrides=["sac.discount=0.5"])
    with pytest.raises(UserError, match="scale = 'paper'"):
        configured({"scale": "paper"})
    part = load(scale="paper", overrides=["seeds=[7]", "methods=[mt_csirl]", "multi_target.tasks=[reach]", "results=x"])
    assert part.scale == "paper", "a part of the design is still at its scale"
    assert load(scale="paper", overrides=["sac.discount=0.5", "scale=desk"]).sac.discount == 0.5
