"""What runs again after a change, and what does not. Dry runs on the finished smoke study."""

import base64
import os
import re
import shutil
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from mtcsirl import cli
from mtcsirl.files.identity import FILE
from mtcsirl.settings import Settings
from mtcsirl.study.design import ARTEFACTS, design
from mtcsirl.study.runs import IrlRun, Transfer
from tests.dag.conftest import SMOKE, Snakemake, job_counts

pytestmark = pytest.mark.dag
Change = Callable[[str, str, str], None]
RUNS = {"train_expert", "train_sac", "collect_demonstrations", "learn_reward", "transfer", "score_reward"}
DRAWN_FROM_NO_RUN = {"figure_1", "figure_8", "figure_9"}


@pytest.fixture
def change(workspace: Path) -> Iterator[Change]:
    """Replace text in a file of the workspace's package (a regular expression), and take it back after the test."""
    kept: dict[Path, bytes] = {}

    def replace(module: str, old: str, new: str) -> None:
        path = workspace / "src/mtcsirl" / module
        text = path.read_text()
        assert re.search(old, text), f"{module} has no {old}"
        kept.setdefault(path, path.read_bytes())
        path.write_text(re.sub(old, new, text, count=1))

    yield replace
    for path, content in kept.items():
        path.write_bytes(content)


def plan(snakemake: Snakemake, *arguments: str) -> dict[str, int]:
    """Jobs per rule that would run again, without the report, which collects everything."""
    planned = job_counts(snakemake("-n", "--quiet", "rules", *SMOKE, *arguments))
    return {name: count for name, count in planned.items() if name not in ("report", "all")}


def stages(planned: dict[str, int]) -> set[str]:
    """The stages among the jobs."""
    return RUNS & set(planned)


def test_a_second_run_has_nothing_to_do(smoke: Path, snakemake: Snakemake) -> None:
    done = snakemake("--cores", "2", *SMOKE)
    assert done.returncode == 0
    assert "Nothing to be done" in done.stdout + done.stderr


NEUTRAL = {
    "a comment": ("agents/sac.py", r"\Z", "\n# said anew\n"),
    "a docstring": ("irl/losses.py", r'"""Logits, penalties', '"""Penalties, logits'),
    "a type": (
        "agents/replay.py",
        r"minibatch: int, recent: int \| None",
        "minibatch: int, recent: 'int | None'",
    ),
    "a reformatted line": ("rewards/curriculum.py", r"R_MAX = 10\.0", "R_MAX = (\n    10.0\n)"),
    "an error's words": ("agents/replay.py", "nothing to sample", "there is nothing to sample"),
    "an optional learner": ("agents/reference.py", r"self\.updates \+= 1", "self.updates += 1 + 0"),
    "the plan": ("study/plan.py", r"LEAST_MINUTES = \d+", "LEAST_MINUTES = 17"),
    "how a job is locked and signed": ("stages/running.py", r"agents: int = 1", "agents: int = 2"),
    "a line for people": ("agents/progress.py", r"_SECONDS_BETWEEN_LINES = 5\.0", "_SECONDS_BETWEEN_LINES = 6.0"),
}


@pytest.mark.parametrize("what", NEUTRAL)
def test_what_changes_no_number_reruns_nothing(smoke: Path, loaded: Snakemake, change: Change, what: str) -> None:
    change(*NEUTRAL[what])
    assert plan(loaded) == {}


def test_a_function_moved_and_a_file_renamed_rerun_nothing(
    smoke: Path, loaded: Snakemake, change: Change, workspace: Path
) -> None:
    source = workspace / "src/mtcsirl/rewards/curriculum.py"
    renamed = source.with_name("lesson.py")
    users = [path for path in (workspace / "src").rglob("*.py") if "rewards.curriculum" in path.read_text()]
    for path in users:
        change(str(path.relative_to(workspace / "src/mtcsirl")), r"rewards\.curriculum", "rewards.lesson")
    source.rename(renamed)
    try:
        assert plan(loaded) == {}
    finally:
        renamed.rename(source)


def test_a_new_key_with_the_value_of_old_reruns_nothing(smoke: Path, loaded: Snakemake, change: Change) -> None:
    key = '    novelty: float = key(0.0, "something new", absent=0.0)\n    device: Annotated[str'
    change("settings/learner.py", r"    device: Annotated\[str", key)
    assert plan(loaded) == {}
    again = plan(loaded, "--config", "sac={novelty: 1.0}")
    assert stages(again) >= {"train_expert", "train_sac", "learn_reward", "transfer"}


CONCERNED = {
    "the policy that new agents keep": (("stages/transfer.py", r'keep="last"', 'keep="best"'), {"transfer"}),
    "a constant of a score": (
        ("results/scoring.py", r"EPIC_TRANSITIONS = 256", "EPIC_TRANSITIONS = 255"),
        {"score_reward"},
    ),
    "how demonstrations are made": (
        ("stages/collect_demonstrations.py", r"seed=shown\.seed", "seed=shown.seed + 1"),
        {"collect_demonstrations", "learn_reward", "transfer", "score_reward"},
    ),
    "the learner": (("agents/gaussian.py", r"SQUASH_EPSILON = 1e-6", "SQUASH_EPSILON = 1e-7"), RUNS),
}


@pytest.mark.parametrize("what", CONCERNED)
def test_an_edit_reruns_what_it_concerns(smoke: Path, loaded: Snakemake, change: Change, what: str) -> None:
    edit, concerned = CONCERNED[what]
    change(*edit)
    planned = plan(loaded)
    assert stages(planned) == concerned
    assert not DRAWN_FROM_NO_RUN & set(planned)


def test_one_methods_logit_reruns_that_method(
    smoke: Path, loaded: Snakemake, change: Change, smoke_settings: Settings
) -> None:
    change("irl/methods/mt_csirl_lt.py", r"temperature / 2", "temperature / 3")
    planned, whole = plan(loaded), design(smoke_settings)
    assert planned["learn_reward"] == sum(run.method == "mt_csirl_lt" for run in whole.irl_runs)
    assert planned["transfer"] == sum(run.irl.method == "mt_csirl_lt" for run in whole.transfers)
    assert not {"train_expert", "train_sac", "collect_demonstrations"} & set(planned)
    shown = {name for name in ARTEFACTS if any(_method(run) == "mt_csirl_lt" for run in design(smoke_settings, name))}
    assert set(planned) - RUNS == shown | {"claims"}


def _method(run: object) -> str:
    irl = run.irl if isinstance(run, Transfer) else run
    return irl.method if isinstance(irl, IrlRun) else ""


def test_a_figure_is_drawn_again_alone(smoke: Path, loaded: Snakemake, change: Change) -> None:
    change("figures/figure_3.py", r"TITLE = ", 'TITLE = "" + ')
    assert plan(loaded) == {"figure_3": 1}


def test_a_style_sheet_redraws_figures_alone(smoke: Path, loaded: Snakemake, change: Change) -> None:
    change("figures/mtcsirl.mplstyle", r"\Z", "\nlines.linewidth: 1.7\n")
    planned = plan(loaded)
    assert not stages(planned)
    drawn = {name for name in ARTEFACTS if name.startswith("figure")}
    assert drawn <= set(planned)
    assert not {"table_2", "table_4", "table_5"} & set(planned)


def test_a_table_is_made_again_alone(smoke: Path, loaded: Snakemake, change: Change) -> None:
    change("tables/table_4.py", r"REMARK = ", 'REMARK = "" + ')
    assert plan(loaded) == {"table_4": 1}


KEYS = {
    "sac={discount: 0.9}": RUNS,
    "transfer={cs_weight: 0.5}": {"transfer"},
    "irl={iterations: 3}": {"learn_reward", "transfer", "score_reward"},
    "score={bootstrap: 21}": {"score_reward"},
    "baseline={steps: {default: 650}}": {"train_sac", "score_reward"},
    "progress={checkpoint_every: 77}": set(),
}


@pytest.mark.parametrize("key", KEYS)
def test_a_changed_key_reruns_what_depends_on_it(smoke: Path, loaded: Snakemake, key: str) -> None:
    planned = plan(loaded, "--config", key)
    assert stages(planned) == KEYS[key]
    assert not DRAWN_FROM_NO_RUN & set(planned), "drawn from no run"


def test_an_added_seed_keeps_the_old_runs(smoke: Path, loaded: Snakemake, smoke_settings: Settings) -> None:
    planned = plan(loaded, "--config", "seeds=[0,1]", "irl_seeds=[0,1]")
    larger = design(smoke_settings.model_copy(update={"seeds": (0, 1), "irl_seeds": (0, 1)})).jobs()
    done = design(smoke_settings).jobs()
    for stage, count in larger.items():
        kept = 0 if stage == "score_reward" else done[stage]  # scores read the policies of all seeds
        assert planned.get(stage, 0) == count - kept, stage


def test_a_lost_file_is_made_again(smoke: Path, loaded: Snakemake) -> None:
    for lost, jobs in (("tables/table_5.tex", {"table_5": 1}), ("sac/reach-wall-t0/s0/curve.csv", {"train_sac": 1})):
        path = smoke / "results/smoke" / lost
        content = path.read_bytes()
        path.unlink()
        try:
            assert {name: n for name, n in plan(loaded).items() if name in jobs} == jobs
        finally:
            path.write_bytes(content)
    assert plan(loaded) == {}


def test_a_run_that_was_signed_while_snakemake_was_killed_hides_nothing(smoke: Path, loaded: Snakemake) -> None:
    """Snakemake holds it for half made; forced to make it again, it would leave out all that needs it."""
    assert plan(loaded) == {}  # which also leaves every marker where it belongs
    (signed,) = smoke.glob("results/smoke/scores/single_target/mt_csirl/velocity/reach-wall/reach-wall-t0/s0/.*.made")
    note = base64.b64encode(str(signed.relative_to(smoke)).encode()).decode()
    half_made, lost = smoke / ".snakemake/incomplete" / note, smoke / "paper_figs/smoke/figure_2.pdf"
    content = lost.read_bytes()
    half_made.parent.mkdir(parents=True, exist_ok=True)
    half_made.touch()
    lost.unlink()
    try:
        assert plan(loaded) == {"figure_2": 1}
    finally:
        half_made.unlink()
        lost.write_bytes(content)


def test_neither_times_nor_records_nor_place_decide(smoke: Path, snakemake: Snakemake, tmp_path: Path) -> None:
    """A clone with results copied in, touched; without Snakemake's records; in another folder."""
    copy = tmp_path / "elsewhere"
    shutil.copytree(smoke, copy, ignore=shutil.ignore_patterns(".snakemake"))
    for index, path in enumerate(sorted(copy.rglob("*"))):
        os.utime(path, (1e9 + index % 7, 1e9 + index % 7))
    done = snakemake("-n", *SMOKE, cwd=copy)
    assert "Nothing to be done" in done.stdout + done.stderr


def check_status_says_why(smoke: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.chdir(smoke)
    command = ["status", "--scale", "smoke", "--target", "figure_2"]
    assert cli.main([*command, "--set", "sac.discount=0.9"]) == 0
    said = [line for line in capsys.readouterr().out.splitlines() if line.startswith("stale: sac/")]
    assert len(said) == 1
    assert "sac.discount: 0.97 -> 0.9" in said[0]


def test_status_says_why(smoke: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    check_status_says_why(smoke, monkeypatch, capsys)


def test_touching_does_not_hide_what_is_stale(
    smoke: Path,
    snakemake: Snakemake,
    loaded: Snakemake,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    key = ("--config", "sac={discount: 0.9}")
    snakemake("--touch", "--cores", "1", *SMOKE, *key)
    assert stages(plan(loaded, *key)) == RUNS
    logs = [log for log in smoke.glob("results/smoke/logs/**/*.log") if not log.stat().st_size]
    assert logs, "touching leaves an empty log per run"
    for log in logs:
        os.utime(log, (1e9, 1e9))
    check_status_says_why(smoke, monkeypatch, capsys)


FLIPPED = (
    "sac/reach-wall-t0/s0/policy.safetensors",
    "sac/reach-wall-t0/s0/evaluation.csv",
    "demonstrations/velocity/reach-wall-t0/s0/demonstrations.parquet",
    "irl/single_target/mt_csirl/velocity/reach-wall/s0/reward.safetensors",
    "irl/single_target/mt_csirl/velocity/reach-wall/s0/samples.parquet",
    "scores/single_target/mt_csirl/velocity/reach-wall/reach-wall-t0/s0/points.parquet",
)


@pytest.mark.parametrize("file", FLIPPED)
def test_one_flipped_bit_is_refused_by_the_reader(smoke: Path, tmp_path: Path, file: str) -> None:
    from mtcsirl.errors import UserError
    from mtcsirl.files import storage

    path = tmp_path / file
    path.parent.mkdir(parents=True)
    for name in (path.name, FILE):
        shutil.copy(smoke / "results/smoke" / Path(file).parent / name, path.parent)
    readers = {"safetensors": storage.read_tensors, "csv": storage.read_csv, "parquet": storage.read_parquet}
    read = readers[path.suffix.removeprefix(".")]
    read(path)
    content = bytearray(path.read_bytes())
    content[len(content) // 2] ^= 1
    path.write_bytes(content)
    with pytest.raises(UserError, match=f"{path.name}.*changed since its run wrote it") as caught:
        read(path)
    assert "\n" not in str(caught.value)
