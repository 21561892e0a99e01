"""The scripts in examples/ run as printed, and are short."""

import os
import platform
import re
import subprocess
import sys
from pathlib import Path

import pytest

from mtcsirl.agents.sac import FusedSac
from mtcsirl.episodes.demonstrations import collect_demonstrations
from mtcsirl.files.identity import read_record
from mtcsirl.files.storage import checksum, read_csv, read_json, write_parquet
from mtcsirl.results.archive import unpack
from mtcsirl.rewards.learned import load_learned_reward, save_learned_reward
from mtcsirl.settings import SacSettings
from mtcsirl.settings.runs import DemonstrationRunSettings
from tests.conftest import CHECKOUT
from tests.rewards.test_learned import learned

pytestmark = pytest.mark.slow

EXAMPLES = sorted((CHECKOUT / "examples").glob("*.py"))


def _run(name: str, folder: Path, *arguments: str) -> str:
    command = [sys.executable, str(CHECKOUT / "examples" / name), *arguments]
    done = subprocess.run(command, cwd=folder, env=dict(os.environ), capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr[-2000:]
    return done.stdout


@pytest.mark.parametrize("file", EXAMPLES, ids=lambda file: file.stem)
def test_each_is_under_forty_lines_and_is_tested(file: Path) -> None:
    text = file.read_text(encoding="utf-8")
    assert len(text.splitlines()) < 40
    assert any(f'"{file.name}"' in test.read_text(encoding="utf-8") for test in CHECKOUT.glob("tests/**/test_*.py"))


def test_sb3_trains_on_the_fast_environment(tmp_path: Path) -> None:
    said = _run("sb3_on_fast_meta_world.py", tmp_path, "--steps", "40", "--cs-reward", "velocity")
    assert re.fullmatch(r"return over 500 steps: -?\d+\.\d\n", said)


def test_a_new_agent_trains_on_a_learned_reward(tmp_path: Path) -> None:
    save_learned_reward(learned(), tmp_path)
    said = _run("new_agent_on_learned_reward.py", tmp_path, ".", "--task", "reach", "--steps", "40")
    assert re.fullmatch(r"task_reward \d+\.\d, f -?\d+\.\d\n", said)


def test_a_method_of_ones_own_learns_a_reward(tmp_path: Path) -> None:
    policy = FusedSac(1, SacSettings(hidden_sizes=(16, 16)), seeds=[7]).policy(0)
    asked = DemonstrationRunSettings(episodes=2, episode_steps=60)
    frame = collect_demonstrations(policy, "reach", 0, asked, seed=0, cs_reward="velocity")
    write_parquet(tmp_path / "shown.parquet", frame)
    smaller = ("evaluation.episode_steps=60", "demonstration_episodes=2", "irl.iterations=1")
    smaller += ("irl.warm_up_iterations=0", "irl.steps_per_iteration=60", "irl.generator_updates=2")
    settings = [part for one in smaller for part in ("--set", one)]
    given = ("--cs-reward", "velocity", "--seed", "100", "--output", "out", "--demonstrations", "shown.parquet")
    config = ("--config", str(CHECKOUT / "config/config.yaml"))
    _run("own_method.py", tmp_path, *given, *settings, *config)
    assert load_learned_reward(tmp_path / "out").method == "mt_gail"
    assert "own_method.py" in read_json(tmp_path / "out" / "identity.json")["code"]


@pytest.mark.skipif(platform.machine() != "x86_64", reason="the kernels of an x86-64 processor")
def test_the_archive_is_made_again_to_the_byte_on_any_x86_processor(tmp_path: Path) -> None:
    """Acting and simulating: a demonstration. Learning: the curve of the first 250 updates of a training."""
    shown, expert = "demonstrations/velocity/reach-wall-t0/s0", "expert/velocity/reach-wall-t0/s0"
    trained = "expert/velocity/drawer-close-t1/s0"
    unpack(CHECKOUT / "results" / "reference", tmp_path, [shown, expert, trained])
    record = read_record(tmp_path / shown)
    assert record is not None
    what = ("--cs-reward", "velocity", "--seed", "0")
    given = ("--expert", expert, "--task", "reach-wall", "--target", "0", "--settings", f"{shown}/settings.json")
    _run("archive_kernels.py", tmp_path, "collect-demonstrations", *given, *what, "--output", "again/shown")
    assert checksum(tmp_path / "again/shown/demonstrations.parquet") == record.files["demonstrations.parquet"]

    given = ("--task", "drawer-close", "--target", "1", "--settings", f"{trained}/settings.json", "--set", "steps=2500")
    _run("archive_kernels.py", tmp_path, "train-expert", *given, *what, "--output", "again/trained")
    curves = [read_csv(tmp_path / folder / "curve.csv").query("step <= 1500") for folder in (trained, "again/trained")]
    assert {"critic_loss", "velocity"} <= set(curves[0]["metric"])
    assert curves[0].equals(curves[1])
