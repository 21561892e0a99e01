"""The command line: every verb explains itself, and every mistake is one line and exit code 2."""

import argparse
import dataclasses
import json
import os
import re
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from mtcsirl import cli
from mtcsirl.commands.arguments import run_settings
from mtcsirl.files import storage
from mtcsirl.files.identity import FILE, Record, checksums, dumps, result_files
from mtcsirl.settings import Settings
from mtcsirl.settings.loading import load
from mtcsirl.settings.runs import AgentRunSettings, expert_run
from mtcsirl.study.design import design
from mtcsirl.study.keys import identity_of
from mtcsirl.study.outputs import OUTPUTS
from mtcsirl.study.plan import cost, plan, wall_hours
from mtcsirl.study.rates import CALIBRATION, Rates, by_minibatch, load_rates
from mtcsirl.study.runs import Expert, IrlRun
from mtcsirl.study.status import DONE, FAILED, RUNNING, STALE, WAITING, run_status, seconds_left, study_status
from tests.conftest import HEEDING

KEY = ["--task", "reach", "--seed", "0"]


def verbs() -> list[str]:
    (action,) = (a for a in cli.parser()._actions if isinstance(a, argparse._SubParsersAction))
    return list(action.choices)


def fails(capsys: pytest.CaptureFixture[str], *arguments: str) -> str:
    """The one line that a wrong call prints."""
    assert cli.main(arguments) == 2
    error = capsys.readouterr().err
    assert error.count("\n") == 1
    assert error.startswith("mtcsirl: ")
    return error


@pytest.mark.parametrize("verb", verbs())
def test_help_says_what_it_does_needs_and_writes(verb: str, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as stopped:
        cli.main([verb, "--help"])
    assert stopped.value.code == 0
    text = capsys.readouterr().out
    assert re.search(r"^needs:  \w", text, re.MULTILINE)
    assert re.search(r"^writes: \S", text, re.MULTILINE)


def test_every_rule_has_a_verb_and_every_stage_a_rule(checkout: Path) -> None:
    rules = "".join(path.read_text() for path in (checkout / "workflow/rules").glob("*.smk"))
    used = set(re.findall(r'"mtcsirl ([a-z-]+)', rules))
    assert used <= set(verbs())
    assert {stage.replace("_", "-") for stage in OUTPUTS} <= used
    assert {"table", "figure", "claims", "report"} <= used


def test_the_library_knows_neither_snakemake_nor_argparse(checkout: Path) -> None:
    for path in (checkout / "src/mtcsirl").rglob("*.py"):
        text = path.read_text()
        assert not re.search(r"^\s*(import|from) snakemake", text, re.MULTILINE), path
        if "commands" not in path.parts and path.name != "cli.py":
            assert "argparse" not in text, path


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (["fly"], "invalid choice: 'fly'"),
        ([], "the following arguments are required: VERB"),
        (["train-sac", "--task", "fly", "--seed", "0", "--output", "x"], "unknown task 'fly'; allowed: assembly, "),
        (["train-sac", "--task", "reach", "--seed", "-1", "--output", "x"], "--seed"),
        (["train-sac", *KEY, "--target", "50", "--output", "x"], "target '50': must be 0 ... 49"),
        (["train-expert", *KEY, "--cs-reward", "speed", "--output", "x"], "unknown common-sense reward 'speed'"),
        (["train-sac", *KEY, "--output", "x", "--set", "sac.minibach=3"], "sac.minibach = 3: unknown key"),
        (["train-sac", *KEY, "--output", "x", "--set", "steps=0"], "steps = 0: must be greater than 0"),
        (["train-sac", *KEY, "--output", "x", "--settings", "{"], "--settings: not valid JSON"),
        (["train-sac", *KEY, "--output", "x", "--settings", "nowhere.json"], "nowhere.json: no such file"),
        (
            ["transfer", *KEY, "--cs-reward", "velocity", "--reward", "nowhere", "--output", "x"],
            "nowhere: no such folder",
        ),
        (["figure", "99"], "invalid choice: '99'"),
        (["plan", "--target", "figure_99"], "unknown artefact 'figure_99'; allowed: table_1, "),
        (["learn-reward", "--method", "gail"], "unknown method 'gail'; allowed: mt_airl, "),
        (["table", "2"], "this run is missing"),
    ],
    ids=lambda value: " ".join(value[:4]) if isinstance(value, list) else "",
)
def test_a_mistake_is_one_line(
    arguments: list[str], says: str, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.chdir(tmp_path)
    assert says in fails(capsys, *arguments)
    assert not list(tmp_path.iterdir()), "nothing is written"


def test_settings_of_a_run_come_from_the_desk_scale_unless_given(monkeypatch: pytest.MonkeyPatch) -> None:
    def of(*arguments: str) -> AgentRunSettings:
        parsed = cli.parser().parse_args(["train-expert", *KEY, "--cs-reward", "velocity", "--output", "x", *arguments])
        return run_settings(parsed, AgentRunSettings, lambda s: expert_run(s, "reach", "velocity"))

    desk = expert_run(load(), "reach", "velocity")
    assert of() == desk
    assert of("--set", "sac.minibatch=64", "--set", "steps=9").sac.minibatch == 64
    assert of("--set", "steps=9").evaluation == desk.evaluation
    given = desk.model_copy(update={"steps": 77})
    assert of("--settings", given.model_dump_json()) == given
    assert of("--settings", given.model_dump_json(), "--set", "steps=78").steps == 78
    assert of("--scale", "smoke") == expert_run(load(scale="smoke"), "reach", "velocity")


def test_settings_verb_prints_what_it_would_load(capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["settings", "json", "--scale", "smoke", "--set", "seeds=[7]"]) == 0
    assert json.loads(capsys.readouterr().out)["seeds"] == [7]
    assert cli.main(["settings", "check", "--scale", "paper"]) == 0
    assert "valid: scale paper" in capsys.readouterr().out


def test_deviations_of_the_paper_scale_are_none(capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["deviations", "--scale", "paper"]) == 0
    assert capsys.readouterr().out == ""
    assert cli.main(["deviations"]) == 0
    assert "sac.minibatch = 64 transitions (paper: 500)" in capsys.readouterr().out


def test_plan_counts_the_jobs_of_the_design(capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["plan", "--target", "table_2", "--scale", "paper"]) == 0
    printed = dict(re.findall(r"^(\w+) +(\d+) ", capsys.readouterr().out, re.MULTILINE))
    expected = design(load(scale="paper"), "table_2").jobs()
    assert {stage: int(printed[stage]) for stage in expected} == expected
    assert int(printed["total"]) == sum(expected.values())


LONE, MANY = 1, 16
EXPERIMENTS = ("single_target", "multi_target", "multi_task")


@pytest.fixture
def rates() -> Rates:
    """Round numbers, so that costs can be worked out by hand."""
    update = {128: 0.01, 256: 0.02}
    discriminators = {"default": {256: 0.008}, "mt_csirl": {256: 0.004}}
    generator = {"step": 0.001, "update": update, "discriminator_update": discriminators, "density": 1e-6}
    return Rates(
        machine="made up",
        start_up=1.0,
        frames=0.5,
        environment_step={"default": 0.001, "push-back": 0.003},
        episode_step=0.0005,
        recorded=0.0001,
        agents={
            LONE: {"step": 0.001, "update": update},
            MANY: {"step": 0.0004, "update": {128: 0.007, 256: 0.014}},
        },
        generators={LONE: generator},
        scored=1.0,
        resampled=1e-6,
        slowdown=1.0,
    )


@pytest.fixture
def small_agents() -> Settings:
    return Settings(
        expert={"steps": {"default": 2000}},
        sac={"minibatch": 128, "updates_per_step": 0.5, "random_steps": 1000},
        progress={"select_every": 1000, "select_episodes": 1},
        evaluation={"episodes": 1, "episode_steps": 500},
    )


def test_cost_of_an_agent_by_hand(rates: Rates, small_agents: Settings) -> None:
    tried, updates = 2 * 500 + 2 * (1 + 1) * 500, (2000 - 1000) * 0.5  # tried, then kept and last evaluated
    reach = cost(Expert("velocity", "reach", 0, 0), small_agents, rates)
    assert reach.seconds == pytest.approx(1.5 + 2000 * 0.002 + tried * 0.0015 + updates * 0.01)
    push = cost(Expert("velocity", "push-back", 0, 0), small_agents, rates)
    assert push.seconds - reach.seconds == pytest.approx((2000 + tried) * 0.002)


def test_among_many_an_agent_costs_what_was_measured_there(rates: Rates, small_agents: Settings) -> None:
    run = Expert("velocity", "reach", 0, 0)
    alone, two, many = (cost(run, small_agents, rates, count).seconds for count in (LONE, 2, MANY))
    assert many == pytest.approx(1.5 / MANY + 2000 * 0.0014 + 3000 * 0.0015 + 500 * 0.007)
    assert many < two < alone


def test_updates_between_and_beyond_the_measured_minibatches(rates: Rates) -> None:
    assert by_minibatch(rates.agents[LONE].update, 192) == pytest.approx(0.015)
    assert by_minibatch(rates.agents[LONE].update, 512) == pytest.approx(0.04)


def test_cost_of_an_irl_run_by_hand(rates: Rates) -> None:
    """By one method of which the cost of discriminators is known, and by one of an extension."""
    settings = Settings(
        irl={
            "iterations": 3,
            "warm_up_iterations": {"default": 2},
            "steps_per_iteration": 100,
            "generator_replay": 2,
            "generator_updates": dict.fromkeys(EXPERIMENTS, 10),
            "discriminator_updates": dict.fromkeys(EXPERIMENTS, 5),
        },
        sac={"minibatch": 128},
        demonstrations={"episodes": dict.fromkeys(EXPERIMENTS, 1)},
        evaluation={"episodes": 1, "episode_steps": 200},
    )
    (run, *_) = design(settings, "figure_6").irl_runs
    # the policy before the first iteration of IRL is tabulated too: 4 times the demonstrations' 200, windows of two
    # rollouts of 100, and the older policy of the mixture in three of the newest rollouts
    tabulated = 4 * 200 + 4 * 200 + 3 * 100
    generator = 500 * 0.002 + 5 * 10 * 0.01 + tabulated * 1e-6 + 500 * 0.0001 + 400 * 0.0015
    known = cost(run, settings, rates).seconds
    assert known == pytest.approx(1.5 + generator + 3 * 5 * 0.004)
    own = dataclasses.replace(run, method="mine")
    assert cost(own, settings, rates).seconds - known == pytest.approx(3 * 5 * 0.004)
    unknown = dataclasses.replace(
        run, method="mt_airl"
    )  # its discriminators learn in the two iterations of warm-up too
    assert cost(unknown, settings, rates).seconds - known > 5 * 5 * 0.008 - 3 * 5 * 0.004


def test_irl_cost_grows_linearly_with_its_members(rates: Rates) -> None:
    settings = load(scale="paper")
    seconds = {}
    for targets in (1, 2):
        own = settings.model_copy(
            update={
                "multi_task": settings.multi_task.model_copy(update={"train_targets": tuple(range(1, targets + 1))})
            }
        )
        (run, *_) = design(own, "table_4").irl_runs
        seconds[len(run.members)] = cost(run, own, rates).seconds - rates.start_up - rates.frames
    (few, some), (many, more) = sorted(seconds.items())
    assert more / some == pytest.approx(many / few)


def test_wall_time_is_bounded_by_work_and_by_the_longest_chain(rates: Rates) -> None:
    settings = load()
    stages = plan(design(settings), settings, rates)
    total = sum(stage.core_hours for stage in stages)
    assert wall_hours(stages, 1) == pytest.approx(total)
    assert wall_hours(stages, 2) == pytest.approx(total / 2)
    assert 0 < wall_hours(stages, 10_000) < total / 100


@pytest.mark.parametrize(
    "change", ["sac.critics=4", "sac.hidden_sizes=[512,512]", "irl.discriminator.hidden_sizes=[512,512]"]
)
def test_larger_networks_cost_more(rates: Rates, change: str) -> None:
    stage = "learn_reward"
    usual, larger = (
        {one.stage: one.core_hours for one in plan(design(settings, "figure_2"), settings, rates)}
        for settings in (load(), load(overrides=[change]))
    )
    assert larger[stage] > 1.05 * usual[stage]
    assert (larger["transfer"] > 1.2 * usual["transfer"]) == change.startswith("sac.")


WRONG = {
    "": "not a readable JSON file",
    "[]": "holds no rates",
    "{}": "lacks machine, start_up, ",
    "start_up: 0": "start_up = 0: must be greater than 0",
    "start_up: -1": "start_up = -1: must be greater than 0",
    "start_up: NaN": "start_up = nan: must be a finite number",
    "start_up: Infinity": "start_up = inf: must be a finite number",
    "agents: {}": "agents: must not be empty",
    'agents: {"1": {"step": 1, "update": {"64": 0}}}': "agents.1.update.64 = 0: must be greater than 0",
    'agents: {"0": {"step": 1, "update": {"64": 1}}}': "agents.0",
    "slowdown: 0.5": "slowdown = 0.5: must be greater than or equal to 1",
    'environment_step: {"reach": 1}': "environment_step: must have a rate named default",
}


@pytest.mark.parametrize("wrong", WRONG)
def test_rates_that_cannot_be_are_refused_in_one_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], wrong: str
) -> None:
    file = tmp_path / "rates.json"
    key, colon, value = wrong.partition(": ")
    rates = json.loads(CALIBRATION.read_text())
    file.write_text(json.dumps(rates | {key: json.loads(value)}) if colon else wrong)
    assert cli.main(["plan", "--target", "table_2", "--rates", str(file)]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert str(file) in line
    assert WRONG[wrong] in line


def test_the_shipped_rates_are_measured() -> None:
    rates = load_rates()
    assert rates.start_up > 0
    lone, many = (rates.agents[count] for count in sorted(rates.agents))
    assert lone.update[500] > lone.update[128]
    assert many.step < lone.step
    assert rates.environment_step["push-back"] > rates.environment_step["default"]


@pytest.fixture
def small(tmp_path: Path) -> Settings:
    return load(scale="smoke", overrides=[f"results={tmp_path}"])


def test_status_follows_a_run(small: Settings, tmp_path: Path) -> None:
    run = Expert("velocity", "reach", 1, 0)
    folder = tmp_path / run.folder
    log = tmp_path / "logs" / run.folder / f"{identity_of(run, small).hash}.log"
    assert run_status(run, small).state == WAITING
    storage.write_text(log, "step 300/600\n")
    assert run_status(run, small).state == RUNNING, "it has just started"
    with storage.locked(folder):
        os.utime(log, (0, 0))
        assert (run_status(run, small).state, run_status(run, small).says) == (RUNNING, "step 300/600")
    assert run_status(run, small).state == FAILED, "an old log, no lock, no result"
    for name in OUTPUTS[run.stage]:
        storage.write_text(folder / name, "x")
    storage.write_json(folder / "settings.json", run.settings(small).model_dump(mode="json"))
    storage.write_json(folder / "provenance.json", {"cost": {"cpu_seconds": 12.0}})
    storage.write_json(folder / "gate.json", {"passed": False})
    record = Record(identity_of(run, small), checksums(folder, result_files(folder)))
    storage.write_text(folder / FILE, dumps(record))
    done = run_status(run, small)
    assert (done.state, done.passed, done.seconds) == (DONE, False, 12.0)
    changed = small.model_copy(update={"expert": small.expert.model_copy(update={"steps": {"default": 601}})})
    assert run_status(run, changed).state == STALE
    assert run_status(run, changed).says == "steps: 400 -> 601"
    storage.write_text(folder / "gate.json", "{")
    assert run_status(run, small).state == FAILED, "a truncated file"
    assert "changed since its run wrote it" in run_status(run, small).says


def test_time_left_is_what_the_done_runs_took(small: Settings, rates: Rates) -> None:
    statuses = study_status(design(small), small)
    assert {status.state for status in statuses} == {WAITING}
    assert seconds_left(statuses, small, rates, 2) == pytest.approx(
        sum(cost(status.run, small, rates).seconds for status in statuses) / 2
    )
    planned = {status.run: cost(status.run, small, rates).seconds for status in statuses}
    smallest = min((run for run in planned if run.stage == IrlRun.stage), key=planned.__getitem__)
    slow = [
        dataclasses.replace(status, state=DONE, seconds=3 * planned[smallest]) if status.run == smallest else status
        for status in statuses
    ]
    irl = sum(seconds for run, seconds in planned.items() if run.stage == IrlRun.stage and run != smallest)
    rest = sum(seconds for run, seconds in planned.items() if run.stage != IrlRun.stage)
    assert seconds_left(slow, small, rates, 2) == pytest.approx((3 * irl + rest) / 2), "a larger run takes longer"


def test_status_verb_on_an_empty_folder(small: Settings, capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["status", "--settings", small.model_dump_json()]) == 0
    text = capsys.readouterr().out
    assert re.search(r"^train_expert +0 +0 +0 +0 +\d+$", text, re.MULTILINE)
    assert "time left" in text


@pytest.mark.slow
@pytest.mark.parametrize(("number", "code"), [(signal.SIGTERM, 143), (signal.SIGINT, 130)])
def test_a_stopped_job_leaves_no_half_written_file(tmp_path: Path, number: int, code: int) -> None:
    run = tmp_path / "run"
    command = [sys.executable, "-m", "mtcsirl.cli", "train-sac", *KEY, "--output", str(run), "--set", "steps=1000000"]
    with subprocess.Popen(command, stderr=subprocess.PIPE, text=True, **HEEDING) as job:
        while not (run / ".lock").exists():
            assert job.poll() is None
            time.sleep(0.05)
        time.sleep(0.5)
        job.send_signal(number)
        error = job.communicate(timeout=60)[1]
    assert job.returncode == code
    assert "Traceback" not in error
    assert not [path for path in run.iterdir() if path.name.endswith(".tmp") or path.name in OUTPUTS["train_sac"]]
    assert not storage.is_locked(run)


@pytest.mark.slow
def test_a_killed_job_goes_on_and_ends_with_the_same_bytes(tmp_path: Path) -> None:
    changes = {"steps": 1500, "sac.minibatch": 32, "sac.updates_per_step": 0.1, "progress.checkpoint_every": 500}
    changes |= {"sac.hidden_sizes": [16, 16], "evaluation.episodes": 1, "evaluation.episode_steps": 100}
    sets = [word for key, value in changes.items() for word in ("--set", f"{key}={value}")]

    def command(folder: str) -> list[str]:
        return [sys.executable, "-m", "mtcsirl.cli", "train-sac", *KEY, *sets, "--output", str(tmp_path / folder)]

    with subprocess.Popen(command("killed"), stderr=subprocess.DEVNULL) as job:
        while not list(tmp_path.glob("killed/checkpoint*")):
            assert job.poll() is None
            time.sleep(0.005)
        job.kill()
    assert not (tmp_path / "killed/policy.safetensors").exists(), "it was killed before its end"
    for folder in ("killed", "whole"):
        subprocess.run(command(folder), check=True, capture_output=True)
    for name in OUTPUTS["train_sac"]:
        if name != "provenance.json":
            assert (tmp_path / "killed" / name).read_bytes() == (tmp_path / "whole" / name).read_bytes(), name
    assert not list(tmp_path.glob("killed/checkpoint*"))
