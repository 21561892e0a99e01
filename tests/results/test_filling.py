"""Files that the archive had not kept come back from runs that were made again, if they have its bytes."""

import os
import shutil
from pathlib import Path

import pytest

from mtcsirl import cli
from mtcsirl.files.identity import FILE, NOTE, read_record
from mtcsirl.files.lock import locked
from mtcsirl.results import archive
from mtcsirl.results.filling import Filled, fill
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


def filled(results: Path, again: Path) -> Filled:
    return fill(results, again, [run.folder for run in STUDY])


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
    found = filled(restored, again)
    assert (set(found.taken), found.left, found.missing) == (absent, (), ())
    assert lacking(restored) == set()
    for name in absent:
        assert (restored / name).read_bytes() == (made / name).read_bytes()
    assert {path: path.read_bytes() for path in before} == before
    assert {path for path in restored.rglob("*") if path.is_file()} == set(before) | {restored / n for n in absent}
    assert {standing(run, settings(restored)).state for run in STUDY} == {DONE}
    assert list(faults(restored)) == []
    assert filled(restored, again) == ((), (), ())


def test_other_bytes_are_left_alone_and_the_rest_is_taken(restored: Path, again: Path) -> None:
    content = bytearray((again / SAMPLES).read_bytes())
    content[len(content) // 2] ^= 1
    (again / SAMPLES).write_bytes(content)
    (again / DEMONSTRATIONS).unlink()
    found = filled(restored, again)
    assert (found.left, found.missing) == (((SAMPLES, "other bytes than the archive's"),), (DEMONSTRATIONS,))
    assert {POLICY, GENERATOR} <= set(found.taken)
    assert lacking(restored) == {SAMPLES, DEMONSTRATIONS}


def test_the_run_made_again_may_differ_elsewhere_and_be_unfinished(restored: Path, again: Path) -> None:
    """As an expert's curve does on another processor; what counts is the file's own bytes."""
    (again / SHOWN.expert.folder / "curve.csv").write_text("step,metric,value\n")
    (again / SHOWN.expert.folder / FILE).unlink()
    before = (restored / SHOWN.expert.folder / "curve.csv").read_bytes()
    assert POLICY in filled(restored, again).taken
    assert (restored / SHOWN.expert.folder / "curve.csv").read_bytes() == before


def test_only_restored_folders_are_filled(restored: Path, again: Path) -> None:
    (restored / SHOWN.folder / NOTE).unlink()
    (restored / IRL.folder / FILE).unlink()
    taken = filled(restored, again).taken
    assert POLICY in taken
    assert not {DEMONSTRATIONS, SAMPLES} & set(taken)


def test_a_folder_that_a_job_holds_is_left_alone_and_the_others_are_filled(restored: Path, again: Path) -> None:
    with locked(restored / IRL.folder):
        found = filled(restored, again)
    assert not (restored / SAMPLES).exists()
    ((folder, why),) = found.left
    assert folder == IRL.folder
    assert "process" in why
    assert {DEMONSTRATIONS, POLICY} <= set(found.taken)


def test_a_record_that_leads_out_of_its_folder_or_is_damaged_is_left_alone(restored: Path, again: Path) -> None:
    for name in (FILE, NOTE):
        path = restored / IRL.folder / name
        path.write_text(path.read_text().replace("samples.parquet", "../../samples.parquet"))
    (restored / SHOWN.folder / FILE).write_text("{")
    found = filled(restored, again)
    assert {folder for folder, _ in found.left} == {IRL.folder, SHOWN.folder}
    assert any("not" in why and "identity" in why for _, why in found.left)
    assert POLICY in found.taken
    assert not (restored / IRL.folder).parents[1].joinpath("samples.parquet").exists()


def test_linked_folders_are_filled_too(restored: Path, again: Path, tmp_path: Path) -> None:
    shutil.move(restored / "irl", tmp_path / "elsewhere")
    (restored / "irl").symlink_to(tmp_path / "elsewhere")
    assert {SAMPLES, GENERATOR} <= set(filled(restored, again).taken)


def test_a_pipe_in_place_of_a_record_holds_nobody_up(restored: Path, again: Path) -> None:
    (restored / SHOWN.folder / FILE).unlink()
    os.mkfifo(restored / SHOWN.folder / FILE)
    (restored / IRL.folder / NOTE).unlink()
    os.mkfifo(restored / IRL.folder / NOTE)
    found = filled(restored, again)
    assert [folder for folder, _ in found.left] == [SHOWN.folder]
    assert POLICY in found.taken
    assert {fault.path for fault in faults(restored)} >= {restored / SHOWN.folder, restored / IRL.folder}


def said(capsys: pytest.CaptureFixture[str], *words: str) -> tuple[int, list[str]]:
    code = cli.main(["archive", "fill", *words])
    printed = capsys.readouterr()
    return code, (printed.out + printed.err).splitlines()


def test_the_verb(restored: Path, again: Path, capsys: pytest.CaptureFixture[str]) -> None:
    words = ["--settings", settings(restored).model_dump_json()]
    number = len(lacking(restored))
    (again / SAMPLES).write_bytes(b"other")
    code, lines = said(capsys, *words, "--again", str(again))
    assert (code, lines) == (
        0,
        [
            f"{SAMPLES}: other bytes than the archive's; left alone",
            f"{number - 1} files taken from {again}, 1 left alone",
            f"0 that the archive had not kept are still missing below {restored}",
        ],
    )


def test_the_verb_heeds_its_target_and_names_what_was_only_restored(
    restored: Path, again: Path, whole: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words = ["--settings", settings(restored).model_dump_json()]
    _, lines = said(capsys, *words, "--again", str(again), "--target", "table_5")
    assert lines[0].startswith("0 files taken")
    archive.unpack(whole, tmp_path / "twice")
    _, lines = said(capsys, *words, "--again", str(tmp_path / "twice"))
    assert lines[0].startswith("0 files taken")
    assert lines[2].startswith(f"{len(lacking(restored))} of these were restored in {tmp_path / 'twice'} as well")


@pytest.mark.parametrize(
    ("asked", "says"),
    [
        ((), "name the results folder to take files from: --again DIR"),
        (("--again", "nowhere"), "nowhere: no such folder; name the results folder below which runs were made again"),
        (("--again", ".", "--archive", "."), "archive fill: takes no --archive; leave it out"),
        (("--again", ".", "--draw-seed", "1"), "archive fill: takes no --draw-seed; leave it out"),
    ],
)
def test_the_verb_refuses(
    restored: Path, asked: tuple[str, ...], says: str, capsys: pytest.CaptureFixture[str]
) -> None:
    code, lines = said(capsys, "--settings", settings(restored).model_dump_json(), *asked)
    assert (code, lines) == (2, [f"mtcsirl: {lines[0].removeprefix('mtcsirl: ')}"])
    assert says in lines[0]


def test_a_mistyped_results_folder_is_not_called_whole(again: Path, capsys: pytest.CaptureFixture[str]) -> None:
    words = ["--settings", settings(again.parent / "no-such").model_dump_json(), "--again", str(again)]
    code, (line,) = said(capsys, *words)
    assert code == 2
    assert "no-such: no such folder; name the results folder below which runs were restored" in line
