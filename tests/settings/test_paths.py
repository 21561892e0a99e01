"""Folders of a study: what cannot be one, or must not, is said when the configuration is read."""

import subprocess
from pathlib import Path

import pytest

from mtcsirl import cli
from mtcsirl.errors import UserError
from mtcsirl.results import parts
from mtcsirl.settings import Settings, paths
from mtcsirl.settings.loading import load

WRONG = {
    "a file": ("README.md", "it is a file; name a folder"),
    "below a file": ("README.md/results", "README.md is a file; name a folder"),
    "a device": ("/dev/null", "it is a device; name a folder"),
    "the root": ("/", "the root of all folders; name one for the study alone"),
    "the root in other words": ("/tmp/..", "the root of all folders"),
    "the checkout": (".", "a folder of this suite's own source"),
    "its source": ("src", "a folder of this suite's own source"),
    "deep in it": ("workflow/rules/../report", "a folder of this suite's own source"),
    "its history": (".git/results", "a folder of this suite's own source"),
    "its environment": (".venv", "a folder of this suite's own source"),
    "its pages": ("docs/x", "a folder of this suite's own source"),
    "where make builds": ("build", "make builds there and may empty it; name another, for example build/check"),
    "what make built": ("build/site/results", "make builds there and may empty it"),
    "its archive": ("results/reference", "it holds an archive of runs; name a folder beside it"),
    "a part of it": ("results/reference/part-0002", "results/reference holds an archive of runs; name a folder beside"),
}


@pytest.mark.parametrize("key", ["results", "figures"])
@pytest.mark.parametrize("what", WRONG)
def test_no_study_is_written_there(
    key: str, what: str, checkout: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(checkout)
    place, says = WRONG[what]
    assert cli.main(["status", "--scale", "smoke", "--set", f"{key}={place}"]) == 2
    error = capsys.readouterr().err
    assert error.count("\n") == 1
    assert key in error
    assert says in error


@pytest.mark.parametrize(
    "place",
    ["results", "results/paper", "build/check", "paper_figs", "elsewhere/deep", "build/reference/results/reference"],
)
def test_other_folders_of_the_checkout_are_free(place: str, checkout: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(checkout)
    assert load(overrides=[f"results={place}"]).results == place


def test_every_folder_that_git_tracks_is_a_source(checkout: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(checkout)
    listed = subprocess.run(["git", "ls-files"], capture_output=True, text=True, check=True).stdout.splitlines()
    folders = {name.partition("/")[0] for name in listed if "/" in name} - {"results", "paper_figs"}
    assert "docs" in folders
    for folder in folders:
        with pytest.raises(UserError, match="a folder of this suite's own source"):
            load(overrides=[f"results={folder}"])


def test_an_archive_is_one_wherever_it_lies_and_nothing_else_is(tmp_path: Path) -> None:
    first, manifest = paths._PART
    assert parts.PART.fullmatch(first)
    assert manifest == parts.MANIFEST
    (tmp_path / first / "study").mkdir(parents=True)
    for free in (tmp_path, tmp_path / first / "study"):  # partitions of a disk may have that name
        assert load(overrides=[f"results={free}"]).results == str(free)
    (tmp_path / first / manifest).write_text("{}")
    for taken in (tmp_path, tmp_path / first, tmp_path / "new", tmp_path / first / "study"):
        with pytest.raises(UserError, match="holds an archive of runs; name a folder beside it"):
            load(overrides=[f"results={taken}"])
    assert load(overrides=[f"results={tmp_path}-new"]), "a folder beside it"


def test_a_folder_outside_may_have_the_name_of_a_source_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "src").mkdir()
    monkeypatch.chdir(tmp_path)
    assert Settings(results="src", figures=".").results == "src"
    (tmp_path / "link").symlink_to(tmp_path / "src")
    assert Settings(results=str(tmp_path / "link")).results.endswith("link")


def test_where_runs_are_noted_is_looked_at_before_minutes_of_work(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "file").write_text("mine")
    assert cli.main(["validate", "--results", "file"]) == 2
    assert "it is a file" in capsys.readouterr().err
    assert [path.name for path in tmp_path.iterdir()] == ["file"]
