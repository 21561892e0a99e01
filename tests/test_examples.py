"""The scripts in examples/ run as printed, and are short."""

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

from mtcsirl.agents.sac import FusedSac
from mtcsirl.episodes.demonstrations import collect_demonstrations
from mtcsirl.files.storage import read_json, write_parquet
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
