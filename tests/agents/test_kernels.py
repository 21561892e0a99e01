"""With the kernels of the archive's processor, runs have the archive's bytes on any x86-64 processor."""

import os
import platform
import subprocess
import sys
from pathlib import Path

import pytest

from mtcsirl.agents.kernels import choose
from mtcsirl.errors import UserError
from mtcsirl.files.identity import read_record
from mtcsirl.files.storage import checksum, read_csv, read_json
from mtcsirl.names import KERNELS
from mtcsirl.results.archive import unpack
from tests.conftest import CHECKOUT

ELSEWHERE = {"OPENBLAS_CORETYPE": "Prescott", "MKL_CBWR": "COMPATIBLE"}
"""Kernels that no processor of today takes by itself."""

x86 = pytest.mark.skipif(platform.machine() != "x86_64", reason="the kernels of an x86-64 processor")


def _mtcsirl(folder: Path, *words: str, **environment: str) -> None:
    command = [sys.executable, "-m", "mtcsirl.cli", *words, "--cs-reward", "velocity", "--seed", "0"]
    here = {name: value for name, value in os.environ.items() if name not in ELSEWHERE}
    done = subprocess.run(command, cwd=folder, env=here | environment, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr[-2000:]


@x86
@pytest.mark.slow
def test_an_archived_policy_shows_what_it_showed(tmp_path: Path) -> None:
    """Acting and simulating."""
    shown, expert = "demonstrations/velocity/reach-wall-t0/s0", "expert/velocity/reach-wall-t0/s0"
    unpack(CHECKOUT / "results" / "reference", tmp_path, [shown, expert])
    record = read_record(tmp_path / shown)
    assert record is not None
    asked = ("collect-demonstrations", "--expert", expert, "--task", "reach-wall", "--target", "0")
    asked += ("--settings", f"{shown}/settings.json")
    _mtcsirl(tmp_path, *asked, "--output", "same", **{KERNELS: "amd"})
    _mtcsirl(tmp_path, *asked, "--output", "other", **ELSEWHERE)
    found = {name: checksum(tmp_path / name / "demonstrations.parquet") for name in ("same", "other")}
    assert found["same"] == record.files["demonstrations.parquet"] != found["other"]
    machines = [read_json(tmp_path / name / "provenance.json")["machine"] for name in ("same", "other")]
    assert [machine.get("kernels") for machine in machines] == ["amd", None]


@x86
@pytest.mark.slow
def test_an_archived_training_starts_as_it_did(tmp_path: Path) -> None:
    """Learning: the curve of the first 250 updates, to the last digit."""
    trained = "expert/velocity/drawer-close-t1/s0"
    unpack(CHECKOUT / "results" / "reference", tmp_path, [trained])
    asked = ("train-expert", "--task", "drawer-close", "--target", "1", "--settings", f"{trained}/settings.json")
    asked += ("--set", "steps=2500")
    _mtcsirl(tmp_path, *asked, "--output", "same", **{KERNELS: "amd"})
    _mtcsirl(tmp_path, *asked, "--output", "other", **ELSEWHERE)
    archived, same, other = (
        read_csv(tmp_path / folder / "curve.csv").query("step <= 1500") for folder in (trained, "same", "other")
    )
    assert {"critic_loss", "velocity"} <= set(archived["metric"])
    assert same.equals(archived)
    assert not other.equals(archived)


def test_nothing_is_chosen_unasked() -> None:
    environment: dict[str, str] = {KERNELS: ""}
    choose(environment)
    assert environment == {KERNELS: ""}


def test_another_value_is_refused() -> None:
    with pytest.raises(UserError, match=f"{KERNELS}=zen: must be amd"):
        choose({KERNELS: "zen"})
