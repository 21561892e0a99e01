"""The command line as a process of its own, on a run of a second."""

import os
import subprocess
import sys
from pathlib import Path
from typing import Any

CHANGES = {
    "steps": 600,
    "sac.minibatch": 32,
    "sac.updates_per_step": 0.1,
    "sac.hidden_sizes": "[16,16]",
    "evaluation.episodes": 1,
    "evaluation.episode_steps": 100,
    "progress.checkpoint_every": 200,
}
RESULTS = {"curve.csv", "evaluation.csv", "gate.json", "policy.json", "policy.safetensors", "settings.json"}
EXPECTED = RESULTS | {"provenance.json", "identity.json"}


def mtcsirl(*words: str) -> list[str]:
    """A command."""
    return [sys.executable, "-m", "mtcsirl.cli", *words]


def train(output: Path, **changes: Any) -> list[str]:
    """The command that trains a small agent; ``changes`` of settings, their dots written as two underscores."""
    settings = CHANGES | {name.replace("__", "."): value for name, value in changes.items()}
    sets = [word for key, value in settings.items() for word in ("--set", f"{key}={value}")]
    return mtcsirl("train-sac", "--task", "reach", "--seed", "0", *sets, "--output", str(output))


def in_shell(command: list[str], redirected: str, **options: Any) -> subprocess.CompletedProcess[str]:
    """Run a command in bash with redirections, as ``$@ {redirected}``; the exit code is the command's own."""
    script = f'"$@" {redirected}; exit ${{PIPESTATUS[0]}}'
    return subprocess.run(["bash", "-c", script, "bash", *command], capture_output=True, text=True, **options)


def one_line(done: subprocess.CompletedProcess[str], code: int = 2) -> str:
    """The one line that a job which failed has printed."""
    assert done.returncode == code, done.stderr
    assert done.stderr.count("\n") == 1, done.stderr
    assert done.stderr.startswith("mtcsirl: ")
    return done.stderr


def environment(**changes: str) -> dict[str, str]:
    """This process's environment with changes."""
    return os.environ | changes
