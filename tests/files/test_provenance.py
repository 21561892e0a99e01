"""Where the code came from, and why where that is not known."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest


def _commit(package: Path, **variables: str) -> str:
    """What `commit` says of the code in ``package``, in a process of its own."""
    code = "from mtcsirl.files.provenance import commit; print(commit())"
    own = {name: value for name, value in os.environ.items() if not name.startswith("GIT_")}
    own |= {"PYTHONPATH": str(package), "HOME": str(package), **variables}
    return subprocess.run([sys.executable, "-c", code], env=own, capture_output=True, text=True, check=True).stdout


@pytest.fixture
def checkout_of_one_commit(checkout: Path, tmp_path: Path) -> Path:
    """A copy of the package under version control; the package lies in its folder src."""
    shutil.copytree(checkout / "src/mtcsirl", tmp_path / "src/mtcsirl", ignore=shutil.ignore_patterns("__pycache__"))
    git = ["git", "-C", str(tmp_path), "-c", "user.name=x", "-c", "user.email=x@example.org"]
    for words in (["init", "-q"], ["add", "."], ["commit", "-qm", "all"]):
        subprocess.run([*git, *words], check=True)
    return tmp_path


def test_a_commit_and_a_changed_tree_are_named(checkout_of_one_commit: Path) -> None:
    source = checkout_of_one_commit / "src"
    head = subprocess.run(
        ["git", "-C", str(source), "rev-parse", "HEAD"], capture_output=True, text=True, check=True
    ).stdout.strip()
    assert _commit(source) == f"{head}\n"
    (source / "mtcsirl/__init__.py").write_text("")
    assert _commit(source) == f"{head}+\n"


def test_no_checkout_and_no_git_are_reasons(checkout_of_one_commit: Path, tmp_path: Path) -> None:
    source = checkout_of_one_commit / "src"
    assert _commit(source, PATH="/nowhere") == "unknown: git is not there\n"
    shutil.rmtree(checkout_of_one_commit / ".git")
    assert _commit(source, GIT_CEILING_DIRECTORIES=str(tmp_path.parent)) == "unknown: no git checkout\n"


@pytest.mark.skipif(os.geteuid() != 0, reason="only root can give a folder to another user")
def test_a_checkout_of_another_user_is_a_reason_with_its_remedy(checkout_of_one_commit: Path) -> None:
    for path in (checkout_of_one_commit, checkout_of_one_commit / ".git"):
        os.chown(path, 12345, 12345)
    says = _commit(checkout_of_one_commit / "src")
    remedy = f"git config --global --add safe.directory {checkout_of_one_commit}"
    assert says == f"unknown: a checkout of another user; {remedy}\n"
