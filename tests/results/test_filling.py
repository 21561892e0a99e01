"""Files that the archive had not kept come back from runs that were made again, if they have its bytes."""

import shutil
from pathlib import Path

import pytest

from mtcsirl import cli
from mtcsirl.errors import UserError
from mtcsirl.files.identity import FILE, NOTE, read_record
from mtcsirl.files.lock import HeldError, locked
from mtcsirl.results import archive
from mtcsirl.results.filling import fill
from mtcsirl.study.standing import DONE, standing
from mtcsirl.study.verification import faults
from tests.results.small_study import IRL, STUDY, settings

SHOWN = IRL.demonstrations[0]
DEMONSTRATIONS = f"{SHOWN.folder}/demonstrations.parquet"
POLICY = f"{SHOWN.expert.folder}/policy.safetensors"
SAMPLES, GENERATOR = f"{IRL.folder}/samples.parquet", f"{IRL.folder}/policies/reach-t1.safetensors"


@pytest.fixture
def restored(whole: Path, tmp_path: Path) -> Path:
    """Runs as an archive restores them: without some of their files."""
    archive.unpack(whole, tmp_path / "restored")
    return tmp_path / "restored"


@pytest.fixture
def again(made: Path, tmp_path: Path) -> Path:
    """The same runs with all of their files."""
    return shutil.copytree(made, tmp_path / "again")


def lacking(results: Path) -> set[str]:
    """Result files that the records name and that are not there."""
    found = set()
    for run in STUDY:
        record = read_record(results / run.folder)
        assert record is not None
        found |= {f"{run.folder}/{name}" for name in record.files if not (results / run.folder / name).is_file()}
    return found


def test_every_file_comes_back_and_nothing_else_changes(restored: Path, again: Path, made: Path) -> None:
    absent = lacking(restored)
    assert {DEMONSTRATIONS, POLICY, SAMPLES, GENERATOR} <= absent
    before = {path: path.read_bytes() for path in restored.rglob("*") if path.is_file()}
    found = fill(restored, again)
    assert (set(found.taken), found.other, found.missing) == (absent, (), ())
    assert lacking(restored) == set()
    for name in absent:
        assert (restored / name).read_bytes() == (made / name).read_bytes()
    assert {path: path.read_bytes() for path in before} == before
    assert {path for path in restored.rglob("*") if path.is_file()} == set(before) | {restored / n for n in absent}
    assert {standing(run, settings(restored)).state for run in STUDY} == {DONE}
    assert list(faults(restored)) == []
    assert fill(restored, again) == ((), (), ())


def test_other_bytes_are_left_alone_and_the_rest_is_taken(restored: Path, again: Path) -> None:
    content = bytearray((again / SAMPLES).read_bytes())
    content[len(content) // 2] ^= 1
    (again / SAMPLES).write_bytes(content)
    (again / DEMONSTRATIONS).unlink()
    found = fill(restored, again)
    assert (found.other, found.missing) == ((SAMPLES,), (DEMONSTRATIONS,))
    assert {POLICY, GENERATOR} <= set(found.taken)
    assert lacking(restored) == {SAMPLES, DEMONSTRATIONS}


def test_the_run_made_again_may_differ_elsewhere_and_be_unfinished(restored: Path, again: Path) -> None:
    """As an expert's curve does on another processor; what counts is the file's own bytes."""
    (again / SHOWN.expert.folder / "curve.csv").write_text("step,metric,value\n")
    (again / SHOWN.expert.folder / FILE).unlink()
    before = (restored / SHOWN.expert.folder / "curve.csv").read_bytes()
    assert POLICY in fill(restored, again).taken
    assert (restored / SHOWN.expert.folder / "curve.csv").read_bytes() == before


def test_only_restored_folders_are_filled(restored: Path, again: Path) -> None:
    (restored / SHOWN.folder / NOTE).unlink()
    (restored / IRL.folder / FILE).unlink()
    taken = fill(restored, again).taken
    assert POLICY in taken
    assert not {DEMONSTRATIONS, SAMPLES} & set(taken)


def test_a_folder_that_a_job_holds_is_not_filled(restored: Path, again: Path) -> None:
    with locked(restored / IRL.folder), pytest.raises(HeldError):
        fill(restored, again)
    assert not (restored / SAMPLES).exists()


def test_a_record_that_leads_out_of_its_folder_is_refused(restored: Path, again: Path) -> None:
    for name in (FILE, NOTE):
        path = restored / IRL.folder / name
        path.write_text(path.read_text().replace("samples.parquet", "../../samples.parquet"))
    with pytest.raises(UserError, match="no file that its stage leaves"):
        fill(restored, again)


def test_the_verb(restored: Path, again: Path, capsys: pytest.CaptureFixture[str]) -> None:
    words = ["archive", "fill", "--settings", settings(restored).model_dump_json()]
    number = len(lacking(restored))
    (again / SAMPLES).write_bytes(b"other")
    assert cli.main([*words, "--again", str(again)]) == 0
    assert capsys.readouterr().out.splitlines() == [
        f"{again / SAMPLES}: has not the archive's bytes; left alone",
        f"{number - 1} files taken from {again}, 1 left alone",
        f"0 that the archive had not kept are still missing below {restored}",
    ]
    assert cli.main(words) == 2
    assert "name the results folder to take files from: --again DIR" in capsys.readouterr().err
    assert cli.main([*words, "--again", str(again / "nowhere")]) == 2
    assert "nowhere: no such folder" in capsys.readouterr().err
