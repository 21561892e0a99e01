"""`make reference` gives the committed tables, figures, verdicts and report from the committed archive, to the byte."""

import shutil
import subprocess
from pathlib import Path

import pytest

from mtcsirl.results.archive import archived, parts, verify
from tests.conftest import CHECKOUT

REFERENCE = CHECKOUT / "results" / "reference"
MOST = 60 * 2**20
COMMITTED = ("paper_figs/figure_2.png", "results/reference/part-0001/manifest.json", "docs/results.md")
committed = pytest.mark.skipif(not parts(REFERENCE), reason="results/reference holds no part yet")


@committed
def test_the_committed_archive_is_sound_and_small():
    assert verify(REFERENCE) == []
    assert sum(path.stat().st_size for path in REFERENCE.rglob("*") if path.is_file()) <= MOST


@committed
@pytest.mark.slow
@pytest.mark.skipif(shutil.which("make") is None, reason="needs make")
def test_make_reference_gives_what_is_committed(tmp_path):
    words = ["make", "--old-file=setup", "reference", f"REFERENCE={tmp_path}"]
    done = subprocess.run(words, cwd=CHECKOUT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr[-2000:]


needs_make = pytest.mark.skipif(
    shutil.which("make") is None or shutil.which("git") is None, reason="needs make and git"
)


def _reference(folder: Path) -> subprocess.CompletedProcess[str]:
    words = ["make", "--old-file=setup", "reference", f"REFERENCE={folder / 'mirror'}"]
    return subprocess.run(words, cwd=folder, capture_output=True, text=True, check=False)


def _checkout(folder: Path) -> Path:
    """What `make reference` looks at before any work."""
    for name in ("Makefile", "README.md"):
        shutil.copy(CHECKOUT / name, folder / name)
    for name in COMMITTED:
        (folder / name).parent.mkdir(parents=True)
        (folder / name).write_text("x")
    return folder


def _commit(folder: Path) -> None:
    subprocess.run(["git", "init", "--quiet"], cwd=folder, check=True)
    subprocess.run(["git", "add", "."], cwd=folder, check=True)


@needs_make
@pytest.mark.parametrize("git", [True, False])
def test_make_reference_fails_where_git_names_nothing_to_compare_with(tmp_path, git):
    """In a tarball, and in a repository that has none of it."""
    if git:
        subprocess.run(["git", "init", "--quiet"], cwd=tmp_path, check=True)
    done = _reference(_checkout(tmp_path))
    assert done.returncode != 0
    assert "git names nothing committed to compare with; clone the repository with git" in done.stderr
    assert "fatal" not in done.stderr
    assert not (tmp_path / "mirror").exists()


@needs_make
@pytest.mark.parametrize("lost", COMMITTED)
def test_make_reference_names_what_is_committed_and_lost(tmp_path, lost):
    _commit(_checkout(tmp_path))
    (tmp_path / lost).unlink()
    done = _reference(tmp_path)
    assert done.returncode != 0
    assert f"make reference: lost: {lost} (git checkout brings it back)" in done.stderr


@committed
@needs_make
def test_make_reference_asks_for_the_runs_that_the_readme_counts():
    words = ["make", "--dry-run", "--old-file=setup", "reference"]
    said = subprocess.run(words, cwd=CHECKOUT, capture_output=True, text=True, check=True).stdout
    assert f"verify --runs {len(archived(REFERENCE))}'" in said
