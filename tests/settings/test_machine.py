"""What this machine cannot do is said before a job, and a scale promises what it says."""

from pathlib import Path

import pytest
import torch

from mtcsirl import cli
from mtcsirl.errors import UserError
from mtcsirl.settings.loading import configured, load
from mtcsirl.settings.machine import check_agent, check_irl, check_study
from mtcsirl.settings.runs import baseline_run, irl_run

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
    ],
)
def test_what_does_not_fit_into_memory_is_named(change: str, names: str) -> None:
    with pytest.raises(
        UserError, match=rf"configuration: {names}: a run would need .* GiB of memory, this machine has"
    ):
        check_study(load(overrides=[change]))


def test_runs_are_held_against_the_memory_too() -> None:
    study = load(overrides=[f"irl.discriminator.hidden_sizes={HUGE}"])
    with pytest.raises(UserError, match=r"irl\.discriminator\.hidden_sizes: a run would need"):
        check_irl(irl_run(study, "single_target", ["reach"]), 1)
    memory = load(overrides=["irl.generator_memory=1000000000000", "irl.iterations=1000000000"])
    with pytest.raises(UserError, match=r"irl\.generator_memory: a run would need"):
        check_irl(irl_run(memory, "single_target", ["reach"]), 1)
    with pytest.raises(UserError, match="steps: a run would need"):
        check_agent(baseline_run(load(overrides=["baseline.steps={default: 1000000000000}"]), "reach"))


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
