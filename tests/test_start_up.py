"""What a job imports before it works: nothing that only pictures, tables or statistics need."""

import subprocess
import sys
from pathlib import Path

import pytest

pytestmark = pytest.mark.slow

STAGES = ("train_expert", "train_sac", "collect_demonstrations", "learn_reward", "transfer", "score_reward")
LEFT_OUT = (
    *("pandas", "pyarrow", "scipy", "matplotlib", "stable_baselines3", "snakemake", "jinja2", "PIL", "minari"),
    *("glfw", "imageio", "OpenGL", "metaworld.policies", "tensorboard"),
)
LOOK = "import sys; print([name for name in {names!r} if name in sys.modules])"


def _after(checkout: Path, code: str) -> str:
    """What of ``LEFT_OUT`` a fresh process has loaded after ``code``."""
    command = [sys.executable, "-c", f"{code}\n{LOOK.format(names=LEFT_OUT)}"]
    return subprocess.run(command, cwd=checkout, capture_output=True, text=True, check=True).stdout.strip()


def test_no_stage_loads_what_it_may_never_need(checkout: Path) -> None:
    imports = "\n".join(f"import mtcsirl.stages.{stage}" for stage in STAGES)
    work = (
        "from mtcsirl.cli import parser\nparser()\n"
        "from mtcsirl.worlds.environments import make_environment\nmake_environment('reach-wall', 0).reset()\n"
        "from mtcsirl.study.code import code_of\ncode_of('train_sac', {})"
    )
    assert _after(checkout, f"{imports}\n{work}") == "[]"


@pytest.mark.parametrize("name", ["scipy", "matplotlib"])
def test_the_look_finds_what_is_loaded(name: str, checkout: Path) -> None:
    assert name in _after(checkout, f"import mtcsirl.stages.train_sac, {name}")


def test_stock_tasks_get_scipy_when_they_ask_for_it(checkout: Path) -> None:
    code = (
        "from mtcsirl.worlds.fast.identity import first_difference, stock_environment\n"
        "assert first_difference('coffee-pull', 1, episodes=1, steps=5) is None\n"
        "import glfw, imageio, metaworld, mujoco.glfw, scipy.spatial.transform as true\n"
        "from metaworld.envs import sawyer_coffee_pull_v3 as task\n"
        "assert task.Rotation.identity().as_quat().tolist() == true.Rotation.identity().as_quat().tolist()\n"
        "assert mujoco.glfw.glfw.create_window is glfw.create_window and imageio.imwrite\n"
        "import gymnasium; gymnasium.spec('Meta-World/MT1')"
    )
    assert "'scipy'" in _after(checkout, code)
