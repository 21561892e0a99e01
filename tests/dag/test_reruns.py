"""What runs again after a change, and what does not. Dry runs on the finished smoke DAG."""

import os
from collections.abc import Callable
from pathlib import Path

import pytest

from mtcsirl.settings import Settings
from mtcsirl.study.design import ARTEFACTS, design
from mtcsirl.study.runs import IrlRun, Transfer
from tests.dag.conftest import SMOKE, TARGETS, Snakemake, job_counts

pytestmark = pytest.mark.dag
Edit = Callable[[str], None]


def plan(snakemake: Snakemake, *arguments: str) -> dict[str, int]:
    """Jobs per rule that would run again, without the report, which collects everything."""
    planned = job_counts(snakemake("-n", *TARGETS, "--quiet", "rules", *SMOKE, *arguments))
    return {name: count for name, count in planned.items() if name not in ("report", "all")}


def test_a_second_run_has_nothing_to_do(smoke: Path, snakemake: Snakemake) -> None:
    done = snakemake("--cores", "2", *TARGETS, *SMOKE)
    assert done.returncode == 0
    assert "Nothing to be done" in done.stdout + done.stderr


def test_a_touched_source_reruns_nothing(smoke: Path, snakemake: Snakemake) -> None:
    os.utime(smoke / "src/mtcsirl/irl/methods/mt_csirl.py")
    assert plan(snakemake) == {}


@pytest.mark.parametrize("method", ["mt_vairl", "mt_csirl"])
def test_an_edited_method_reruns_that_method(
    smoke: Path, snakemake: Snakemake, edit: Edit, smoke_settings: Settings, method: str
) -> None:
    edit(f"irl/methods/{method}.py")
    planned = plan(snakemake)
    study = design(smoke_settings)
    assert planned["learn_reward"] == sum(run.method == method for run in study.irl_runs)
    assert planned["transfer"] == sum(run.irl.method == method for run in study.transfers)
    assert not {"train_expert", "train_sac", "collect_demonstrations"} & set(planned)
    read = {name for name in ARTEFACTS if _reads(design(smoke_settings, name), method)}
    assert set(planned) - {"learn_reward", "transfer", "score_reward"} == read | {"claims"}


def _reads(study: object, method: str) -> bool:
    runs = [run.irl if isinstance(run, Transfer) else run for run in study]  # type: ignore[attr-defined]
    return any(isinstance(run, IrlRun) and run.method == method for run in runs)


def test_an_edited_figure_is_drawn_again_alone(smoke: Path, snakemake: Snakemake, edit: Edit) -> None:
    edit("figures/figure_3.py")
    assert plan(snakemake) == {"figure_3": 1}


def test_an_edited_table_is_made_again_alone(smoke: Path, snakemake: Snakemake, edit: Edit) -> None:
    edit("tables/table_2.py")
    assert plan(snakemake) == {"table_2": 1}


def test_an_edited_learner_reruns_every_run(
    smoke: Path, snakemake: Snakemake, edit: Edit, smoke_settings: Settings
) -> None:
    edit("agents/sac.py")
    assert plan(snakemake).items() >= design(smoke_settings).jobs().items()


CHANGES = {
    "transfer={cs_weight: 0.5}": {"transfer"},
    "irl={iterations: 3}": {"learn_reward", "transfer", "score_reward"},
    "score={bootstrap: 21}": {"score_reward"},
    "baseline={steps: {default: 650}}": {"train_sac", "score_reward"},
    "demonstrations={episodes: {single_target: 2}}": {
        "collect_demonstrations",
        "learn_reward",
        "transfer",
        "score_reward",
    },
}


@pytest.mark.parametrize("change", CHANGES)
def test_a_changed_key_reruns_what_depends_on_it(smoke: Path, snakemake: Snakemake, change: str) -> None:
    planned = plan(snakemake, "--config", change)
    assert {name for name in planned if name not in ARTEFACTS} - {"claims"} == CHANGES[change]
    assert not {"figure_1", "figure_8", "figure_9"} & set(planned), "drawn from no run"


def test_a_budget_of_one_task_reruns_that_task(smoke: Path, snakemake: Snakemake, smoke_settings: Settings) -> None:
    planned = plan(snakemake, "--config", "transfer={steps: {push-back: 700}}")
    assert planned["transfer"] == sum(run.task == "push-back" for run in design(smoke_settings).transfers)


def test_an_added_seed_keeps_the_old_runs(smoke: Path, snakemake: Snakemake, smoke_settings: Settings) -> None:
    planned = plan(snakemake, "--config", "seeds=[0,1]", "irl_seeds=[0,1]")
    larger = design(smoke_settings.model_copy(update={"seeds": (0, 1), "irl_seeds": (0, 1)})).jobs()
    done = design(smoke_settings).jobs()
    for stage, count in larger.items():
        assert planned.get(stage, 0) == count - done[stage]


def test_a_lost_file_is_made_again(smoke: Path, snakemake: Snakemake) -> None:
    lost = smoke / "results/smoke/tables/table_5.tex"
    content, times = lost.read_bytes(), lost.stat()
    lost.unlink()
    try:
        assert plan(snakemake) == {"table_5": 1}
    finally:
        lost.write_bytes(content)
        os.utime(lost, ns=(times.st_atime_ns, times.st_mtime_ns))
