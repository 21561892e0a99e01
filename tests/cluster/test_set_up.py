"""Without a cluster: the extra, its pin and the profile agree with each other."""

import re
import tomllib
from pathlib import Path

import pytest
import yaml

PLUGIN = "snakemake-executor-plugin-slurm"


@pytest.fixture
def profile(checkout: Path) -> dict[str, object]:
    return yaml.safe_load((checkout / "profiles/slurm/profile.yaml").read_text(encoding="utf-8"))


def test_the_extra_is_pinned_and_set_up_installs_it(checkout: Path) -> None:
    extras = tomllib.loads((checkout / "pyproject.toml").read_text(encoding="utf-8"))["project"][
        "optional-dependencies"
    ]
    assert [PLUGIN in wanted for wanted in extras["slurm"]] == [True]
    pins = (checkout / "constraints.txt").read_text(encoding="utf-8")
    assert re.search(rf"^{PLUGIN}==2\.", pins, re.MULTILINE)
    assert re.search(rf"^{PLUGIN}-jobstep==", pins, re.MULTILINE)
    made = (checkout / "Makefile").read_text(encoding="utf-8")
    assert "slurm" in re.search(r"^EXTRAS := (.*)$", made, re.MULTILINE)[1].split(",")  # type: ignore[index]


def test_the_profile_asks_for_nothing_that_needs_accounting(profile: dict[str, object]) -> None:
    assert profile["executor"] == "slurm"
    assert profile["slurm-status-command"] == "squeue"
    assert "slurm_account" not in profile["default-resources"]  # type: ignore[operator]


def test_time_and_memory_of_runs_are_the_plans_alone(profile: dict[str, object], checkout: Path) -> None:
    assert "set-resources" not in profile
    rules = "".join(file.read_text(encoding="utf-8") for file in (checkout / "workflow/rules").glob("*.smk"))
    for kind in ("Expert", "Baseline", "Demonstrations", "IrlRun", "Transfer", "Score"):
        assert f"mem_mb=memory_of({kind})" in rules
        assert f"runtime=minutes_of({kind})" in rules


def test_the_page_names_every_setting_of_the_profile_that_a_cluster_changes(checkout: Path) -> None:
    page = (checkout / "docs/cluster.md").read_text(encoding="utf-8")
    for word in ("slurm_partition", "slurm_account", "gpu=1", "--jobs", "kubernetes", "aws-batch", "lsf"):
        assert word in page
