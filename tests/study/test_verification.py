"""A results folder is checked file by file."""

from pathlib import Path

import pytest

from mtcsirl import cli
from mtcsirl.files import storage
from mtcsirl.files.identity import FILE, Identity, Record, checksums, dumps, result_files
from mtcsirl.study.verification import faults


@pytest.fixture
def results(tmp_path: Path) -> Path:
    """Two runs, signed."""
    for seed in (0, 1):
        folder = tmp_path / f"sac/reach-t0/s{seed}"
        for name in ("curve.csv", "settings.json", "policies/reach.json", "provenance.json"):
            storage.write_text(folder / name, f"{name} {seed}")
        identity = Identity("train_sac", {"seed": seed}, {}, {}, {})
        storage.write_text(folder / FILE, dumps(Record(identity, checksums(folder, result_files(folder)))))
    return tmp_path


def test_a_whole_study_has_no_fault(results: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert not list(faults(results))
    assert cli.main(["verify", str(results)]) == 0
    assert "every file is what its run wrote" in capsys.readouterr().out


def _flip(path: Path) -> None:
    content = bytearray(path.read_bytes())
    content[-1] ^= 1
    path.write_bytes(content)


DAMAGE = {
    "a flipped bit": (lambda folder: _flip(folder / "curve.csv"), "curve.csv changed since its run wrote it"),
    "a flipped bit further down": (lambda folder: _flip(folder / "policies/reach.json"), "policies/reach.json changed"),
    "a lost file": (lambda folder: (folder / "curve.csv").unlink(), "lost curve.csv"),
    "a truncated record": (lambda folder: storage.write_text(folder / FILE, "{"), "not a readable identity"),
    "an edited record": (
        lambda folder: storage.write_text(folder / FILE, (folder / FILE).read_text().replace('"seed":0', '"seed":7')),
        "does not fit its own hash",
    ),
    "a foreign file": (lambda folder: storage.write_text(folder / "own.csv", "x"), "no file of its run"),
    "no record": (lambda folder: (folder / FILE).unlink(), "without identity.json"),
    "a dead writer's file": (lambda folder: (folder / ".curve.csv.12.tmp").touch(), "left by a writer"),
}


@pytest.mark.parametrize("what", DAMAGE)
def test_what_is_wrong_is_named(results: Path, capsys: pytest.CaptureFixture[str], what: str) -> None:
    damage, said = DAMAGE[what]
    damage(results / "sac/reach-t0/s0")
    (found,) = faults(results)
    assert said in found.why
    assert "s0" in str(found.path)
    assert cli.main(["verify", str(results)]) == 2
    printed = capsys.readouterr()
    assert printed.out.startswith("delete ")
    assert printed.err.count("\n") == 1


NO_RUN = {
    "nothing": [],
    "sources": ["cli.py", "deep/module.py"],
    "settings of an editor": [".vscode/settings.json"],
    "somebody's identity": ["identity.json", "thesis.tex"],
    "a temporary of somebody": [".draft.tmp"],
}


@pytest.mark.parametrize("what", NO_RUN)
def test_where_no_run_is_nothing_is_said_to_be_whole(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], what: str
) -> None:
    for name in NO_RUN[what]:
        storage.write_text(tmp_path / name, "{}")
    assert cli.main(["verify", str(tmp_path)]) == 2
    printed = capsys.readouterr()
    assert printed.out == ""
    assert printed.err == f"mtcsirl: {tmp_path}: holds no run; name the results folder of a study, or of one run\n"


def test_one_run_alone_can_be_verified(results: Path) -> None:
    assert cli.main(["verify", str(results / "sac/reach-t0/s0")]) == 0


def test_no_such_folder_is_one_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["verify", str(tmp_path / "none")]) == 2
    assert capsys.readouterr().err.count("\n") == 1


def _elsewhere(results: Path) -> None:
    """All runs of one stage on another disk, linked back."""
    (results / "sac").rename(results.parent / "elsewhere")
    (results / "sac").symlink_to(results.parent / "elsewhere", target_is_directory=True)


@pytest.fixture
def linked(tmp_path: Path, results: Path) -> Path:
    """The two runs behind a link, which they are to be found through."""
    inner = tmp_path / "results"
    inner.mkdir()
    (results / "sac").rename(inner / "sac")
    _elsewhere(inner)
    return inner


def test_runs_behind_a_link_are_looked_at(linked: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["verify", str(linked)]) == 0
    _flip(linked / "sac/reach-t0/s0/curve.csv")
    assert cli.main(["verify", str(linked)]) == 2
    assert "curve.csv changed since its run wrote it" in capsys.readouterr().out
    (found,) = faults(linked)
    assert found.path == linked / "sac/reach-t0/s0", "under the name that it has here"


@pytest.mark.parametrize("what", DAMAGE)
def test_what_is_wrong_behind_a_link_is_named(linked: Path, what: str) -> None:
    damage, said = DAMAGE[what]
    damage(linked / "sac/reach-t0/s0")
    (found,) = faults(linked)
    assert said in found.why


def test_one_run_that_is_a_link_is_looked_at(results: Path) -> None:
    folder = results / "sac/reach-t0/s0"
    folder.rename(results.parent / f"{results.name}-s0")
    folder.symlink_to(results.parent / f"{results.name}-s0", target_is_directory=True)
    assert not list(faults(results))
    _flip(folder / "policies/reach.json")
    assert [fault.path for fault in faults(results)] == [folder]


def test_links_in_a_circle_end(results: Path) -> None:
    folder = results / "sac/reach-t0"
    for name, leads in {"itself": folder, "up": results, "gone": results / "nowhere", "twice": folder / "s0"}.items():
        (folder / name).symlink_to(leads, target_is_directory=True)
    assert not list(faults(results))
    _flip(folder / "s0/curve.csv")
    assert len(list(faults(results))) == 1, "what two names lead to is wrong once"
