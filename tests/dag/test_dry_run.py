"""Every target can be planned at every scale, with as many jobs as the design says; mistakes are caught before."""

from pathlib import Path

import pytest

from mtcsirl import cli
from mtcsirl.files.identity import marker
from mtcsirl.names import KERNELS
from mtcsirl.settings.loading import load
from mtcsirl.study.ablations import ABLATIONS
from mtcsirl.study.design import ARTEFACTS, design
from mtcsirl.study.keys import Run, identity_of
from tests.dag.conftest import Snakemake, job_counts
from tests.study.made_up import finish


def dry_run(snakemake: Snakemake, scale: str, *targets: str) -> dict[str, int]:
    overlay = () if scale == "desk" else ("--configfile", f"config/{scale}.yaml")
    return job_counts(snakemake("-n", *targets, "--quiet", "rules", *overlay))


@pytest.mark.parametrize("target", ARTEFACTS)
@pytest.mark.parametrize("scale", ["desk", "paper"])
def test_an_artefact_plans_the_jobs_that_the_design_says(planner: Snakemake, scale: str, target: str) -> None:
    assert dry_run(planner, scale, target) == design(load(scale=scale), target).jobs() | {target: 1}


@pytest.mark.parametrize("target", ABLATIONS)
def test_an_ablation_plans_its_runs_by_the_rules_of_the_main_study(planner: Snakemake, target: str) -> None:
    assert dry_run(planner, "desk", target) == design(load(scale="desk"), target).jobs() | {target: 1}


def test_diagnostics_needs_irl_runs_and_what_they_need_alone(planner: Snakemake) -> None:
    planned, jobs = dry_run(planner, "desk", "diagnostics"), design(load(scale="desk")).jobs()
    runs = jobs["learn_reward"]
    assert planned["learn_reward"] == planned["draw_diagnostics"] == runs
    assert planned.keys() == {
        "train_expert", "collect_demonstrations", "learn_reward", "draw_diagnostics", "diagnostics"
    }  # fmt: skip


@pytest.mark.parametrize("scale", ["smoke", "desk", "paper"])
def test_all_is_the_whole_study_with_every_artefact(snakemake: Snakemake, scale: str) -> None:
    planned = dry_run(snakemake, scale)
    artefacts = dict.fromkeys([*ARTEFACTS, "claims", "report", "all"], 1)
    assert planned == design(load(scale=scale)).jobs() | artefacts


@pytest.mark.parametrize("target", ["claims", "report", "all"])
def test_collecting_targets_need_the_whole_study(planner: Snakemake, target: str) -> None:
    planned = dry_run(planner, "smoke", target)
    assert planned.items() >= design(load(scale="smoke")).jobs().items()
    assert planned[target] == 1


@pytest.mark.parametrize("folder", ["expert/velocity/reach-t1/s0", "results/expert/velocity/reach-t1/s0"])
def test_one_run_can_be_asked_for(
    planner: Snakemake,
    workspace: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    folder: str,
) -> None:
    monkeypatch.chdir(workspace)
    assert cli.main(["target", folder]) == 0
    planned = dry_run(planner, "desk", capsys.readouterr().out.strip())
    assert planned == {"train_expert": 1}
    assert cli.main(["target", folder, "sac/reach-wall-t0/s0"]) == 0
    assert len(capsys.readouterr().out.split()) == 2
    assert cli.main(["target", folder, "expert/velocity/reach-t1/s7"]) == 2
    said = capsys.readouterr()
    assert "is no run of the study at scale desk" in said.err
    done = planner("-n", *said.out.split())
    assert done.returncode != 0, "nothing to ask for would be the whole study"
    assert "no-such-run" in done.stdout + done.stderr


def test_a_run_outside_the_study_is_refused(planner: Snakemake) -> None:
    done = planner("-n", "results/expert/velocity/reach-t1/s7/.0123456789abcdef.made")
    assert done.returncode != 0
    assert "expert/velocity/reach-t1/s7 is no run of the study at scale desk" in done.stdout + done.stderr


def test_what_is_missing_above_a_finished_run_is_made_whatever_is_missing_below(
    planner: Snakemake, tmp_path: Path
) -> None:
    """A new agent and the expert below its reward, which is done: Snakemake alone forgets the agent."""
    settings = load((), (f"results={tmp_path / 'results'}",))
    agent = design(settings, "figure_2").transfers[0]
    demonstrations = agent.irl.demonstrations[0]

    def planned(*runs: Run) -> dict[str, int]:
        hashes = {run: identity_of(run, settings).hash for run in runs}
        targets = [f"{settings.results}/{run.folder}/{marker(hash)}" for run, hash in hashes.items()]
        return dry_run(planner, "desk", *targets, "--config", f"results={settings.results}")

    finish(demonstrations, settings)
    rest = {"train_expert": 1, "transfer": 1}
    assert planned(demonstrations.expert, agent) == rest | {"learn_reward": 1}
    finish(agent.irl, settings)
    assert planned(demonstrations.expert, agent) == rest
    assert planned(agent) == {"transfer": 1}
    finish(demonstrations.expert, settings)
    assert planned(demonstrations.expert, agent) == {"transfer": 1}


BAD = {
    "unknown key": ("sac={minibach: 3}", "sac.minibach = '3': unknown key, did you mean minibatch?"),
    "unknown section": ("sack={}", "sack: unknown key"),
    "wrong type": ("sac={minibatch: many}", "sac.minibatch = 'many': must be a valid integer"),
    "unknown task": ("single_target={tasks: [fly]}", "unknown task 'fly'; allowed: "),
    "unknown method": ("methods=[gail]", "unknown method 'gail'; allowed: mt_airl, "),
    "unknown cs-reward": ("cs_rewards=[speed]", "unknown common-sense reward 'speed'; allowed: velocity, action_norm"),
    "empty list": ("seeds=[]", "seeds = []: must not be empty"),
    "negative budget": ("expert={steps: {default: -1}}", "expert.steps.default = '-1': must be greater than 0"),
}


@pytest.mark.parametrize("mistake", BAD)
def test_a_bad_configuration_is_one_line_and_leaves_no_trace(planner: Snakemake, tmp_path: Path, mistake: str) -> None:
    value, says = BAD[mistake]
    done = planner("--cores", "1", "--config", value, cwd=tmp_path)
    assert done.returncode != 0
    (line,) = [line for line in done.stderr.splitlines() if line.startswith("--config: ")]
    assert says in line
    assert "Traceback" not in done.stderr
    assert {path.name for path in tmp_path.iterdir()} <= {".snakemake"}, "no result is written"


def test_kernels_that_there_are_not_end_it_before_it_starts(
    snakemake: Snakemake, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv(KERNELS, "zen")
    done = snakemake("--cores", "1", "sac/reach-wall-t0/s0", cwd=tmp_path)
    assert done.returncode != 0
    assert done.stderr.splitlines()[-1] == f"{KERNELS}=zen: must be amd, or not be set"
    assert {path.name for path in tmp_path.iterdir()} <= {".snakemake"}
    monkeypatch.setenv(KERNELS, "amd")
    assert job_counts(snakemake("-n", "figure_1", "--quiet", "rules")) == {"figure_1": 1}
