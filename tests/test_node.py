"""A machine with a GPU: what the benchmark prints, what the profile sends there, and what stays on the CPU."""

import re
from pathlib import Path

import pytest
import yaml
from benchmarks import node

from mtcsirl import cli
from mtcsirl.errors import UserError
from mtcsirl.settings.loading import load
from mtcsirl.settings.runs import baseline_run, expert_run, irl_run, transfer_run

STAGES_ON_GPU = {"train_expert", "train_sac", "learn_reward", "transfer"}


@pytest.mark.slow
def test_the_benchmark_prints_a_rate_for_every_size_and_the_cost_of_both_scales(
    capsys: pytest.CaptureFixture[str],
) -> None:
    node.main(["--device", "cpu", "--agents", "1", "2", "--together", "2", "--seconds", "0.1", "--rollout", "60"])
    said = capsys.readouterr().out
    assert "a GPU: not measured" in said.splitlines()[0]
    rates = re.findall(r"^(.*): (\d+) steps/s, environment (\d+)%, no GPU$", said, re.MULTILINE)
    assert [name for name, _, _ in rates] == [
        "1 agents, desk scale",
        "2 agents, desk scale",
        "1 agents, paper scale",
        "IRL of 2 generators, desk scale",
    ]
    assert all(int(steps) > 0 and 0 <= int(share) < 100 for _, steps, share in rates)
    assert len(re.findall(r"^(?:desk|paper) scale: .* hours here", said, re.MULTILINE)) == 2


def test_an_unknown_device_is_one_line() -> None:
    with pytest.raises(UserError, match="cuda:9"):
        node.main(["--device", "cuda:9"])


def test_thirty_generators_are_thirty_pairs_of_task_and_target() -> None:
    assert len(set(node.members(30))) == 30
    assert all(target > 0 for _, target in node.members(30))


def test_every_run_that_learns_takes_the_device_of_the_study() -> None:
    settings = load(overrides=["sac.device=cuda"])
    assert baseline_run(settings, "reach").sac.device == "cuda"
    assert expert_run(settings, "reach", "velocity").sac.device == "cuda"
    assert transfer_run(settings, "reach").sac.device == "cuda"
    assert irl_run(settings, "multi_task", ["reach"], "mt_csirl").sac.device == "cuda"


def test_the_profile_shares_the_gpu_among_the_stages_that_use_it(checkout: Path) -> None:
    profile = yaml.safe_load((checkout / "profiles/node/profile.yaml").read_text(encoding="utf-8"))
    rules = "".join(file.read_text(encoding="utf-8") for file in (checkout / "workflow/rules").glob("*.smk"))
    assert set(profile["set-resources"]) == STAGES_ON_GPU
    assert all(f"rule {name}:" in rules for name in profile["set-resources"])
    assert profile["resources"] == ["gpu=100"]
    assert all(own["gpu"] <= 100 for own in profile["set-resources"].values())
    default = yaml.safe_load((checkout / "profiles/default/profile.yaml").read_text(encoding="utf-8"))
    assert profile["rerun-triggers"] == default["rerun-triggers"]


@pytest.mark.parametrize("verb", ["train-sac", "train-expert", "transfer", "train-together"])
def test_device_stands_for_its_settings_key(verb: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    velocity = ["--cs-reward", "velocity"]
    key = {"train-sac": [], "train-expert": velocity, "transfer": [*velocity, "--reward", str(tmp_path)]}.get(verb)
    own = [] if key is None else [*key, "--task", "reach", "--seed", "0", "--output", str(tmp_path / "run")]
    assert cli.main([verb, *own, "--set", f"{'results' if not own else 'steps'}={tmp_path if not own else 9}",
                     "--device", "cuda:77"]) == 2  # fmt: skip
    assert "sac.device = 'cuda:77': this machine has" in capsys.readouterr().err
    assert cli.main([verb, *own, "--device", "gpu"]) == 2
    assert "must be cpu, cuda or cuda:INDEX" in capsys.readouterr().err
