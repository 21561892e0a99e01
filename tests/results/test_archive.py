"""The archive gives back what was put in, byte for byte, or says in one line that it does not."""

import json
import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import torch

from mtcsirl import cli
from mtcsirl.errors import UserError
from mtcsirl.files import storage
from mtcsirl.files.identity import FILE, NOT_RESULTS, NOTE, read_record, result_files
from mtcsirl.files.lock import locked
from mtcsirl.results import archive, packing
from mtcsirl.rewards.learned import load_learned_reward
from mtcsirl.settings import Settings
from mtcsirl.stages.running import Task, begin, finished
from mtcsirl.study.design import design
from mtcsirl.study.keys import identity_of
from mtcsirl.study.outputs import OUTPUTS
from mtcsirl.study.standing import DONE, INCOMPLETE, settle, standing
from mtcsirl.study.status import study_status
from mtcsirl.study.verification import faults
from tests.conftest import CHECKOUT
from tests.results.made_up import sign
from tests.results.small_study import IRL, SCORE, SCORED, SHOWN, STUDY, add, reward, settings, write
from tests.words import learn_reward


@pytest.fixture
def copy(whole: Path, tmp_path: Path) -> Path:
    return Path(shutil.copytree(whole, tmp_path / "copy"))


def files(folder: Path) -> dict[str, bytes]:
    return {path.relative_to(folder).as_posix(): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


# --- out of the archive comes what went in -------------------------------------------------------------------------


def test_every_kept_file_comes_back_byte_for_byte(whole, made, tmp_path):
    found = archive.unpack(whole, tmp_path)
    assert set(found.restored) == {run.folder for run in STUDY}
    before, after = files(made), files(tmp_path)
    notes = {name for name in after if name.endswith(NOTE)}
    assert {name: before[name] for name in set(after) - notes} == {name: after[name] for name in set(after) - notes}


def test_what_is_not_kept_is_what_should_not_be(whole, made, tmp_path):
    archive.unpack(whole, tmp_path)
    gone = {name for name in set(files(made)) - set(files(tmp_path)) if not name.endswith(".made")}
    large = {"samples.parquet", "demonstrations.parquet", "diagnostics.csv"}
    others = {name for name in gone if Path(name).name not in large}
    assert {Path(name).suffix for name in others} == {".safetensors"}
    assert not {str(Path(name).parent) for name in others} & SCORED
    assert {f"{run.folder}/policy.safetensors" for run in STUDY.transfers} <= others
    assert not [name for name in gone if "reward" in name]
    for run in STUDY:
        note = json.loads((tmp_path / run.folder / NOTE).read_text())
        assert {f"{run.folder}/{name}" for name in note["not_kept"]} == {n for n in gone if n.startswith(run.folder)}


def test_the_policies_kept_are_those_that_a_score_reads():
    assert archive.policies_kept(STUDY) == SCORED
    whole = design(Settings())
    kept = archive.policies_kept(whole)
    assert len(kept) == 75
    assert {run.folder for run in whole.baselines} <= kept
    assert kept - {run.folder for run in whole.baselines} <= {run.expert.folder for run in whole.demonstrations}


def test_frames_are_tidy(whole, made):
    curve = archive.read(whole, "curve")
    own = curve[curve["folder"] == IRL.folder]
    original = storage.read_csv(made / IRL.folder / "curve.csv")
    assert own["value"].to_list() == original["value"].to_list()
    points = archive.read(whole, "points")
    assert set(points["folder"]) == {run.folder for run in STUDY.scores}
    assert points["truth"].dtype == np.float32
    assert set(archive.read(whole, "evaluation")["folder"]) == {run.folder for run in (*STUDY.agents, *STUDY.irl_runs)}
    with pytest.raises(UserError, match="no frame 'rows'"):
        archive.read(whole, "rows")


def test_diagnostics_are_thinned(whole):
    found = archive.read(whole, "diagnostics")
    assert sorted(set(found["step"])) == [5000, 10000, 11500]
    assert set(found["discriminator"]) == {"", "reach-t1"}


def test_a_reward_from_the_archive_is_the_one_that_was_learned(whole, tmp_path):
    archive.unpack(whole, tmp_path, [IRL.folder])
    found = load_learned_reward(tmp_path / IRL.folder)
    assert torch.equal(found.network.parameters, reward(IRL).network.parameters)
    assert [run for run in STUDY if (tmp_path / run.folder).exists()] == [IRL]


@pytest.mark.parametrize("values", [[0.0, -0.0, 1.5, -2.75e-30], [np.inf, -np.inf, np.nan, 3e38]])
def test_words_come_back_however_they_look(values):
    content = np.array(values, "<f4").tobytes() + b"\xff\x00\x80\x01"
    exponents, rest = packing.split(content)
    assert packing.joined(exponents, rest) == content
    assert len(exponents) * 3 == len(rest)


# --- a workflow goes on from it --------------------------------------------------------------------------------------


def test_a_restored_study_is_done_for_everyone(whole, tmp_path):
    archive.unpack(whole, tmp_path)
    at = settings(tmp_path)
    wanted = settle(STUDY, at)
    for run in STUDY:
        assert standing(run, at).state == DONE
        assert (tmp_path / run.folder / f".{wanted[run.folder]}.made").is_file()
    assert {status.state for status in study_status(STUDY, at)} == {DONE}
    assert list(faults(tmp_path)) == []
    record = read_record(tmp_path / IRL.folder)
    assert record is not None
    assert finished(Task(record.identity, IRL.settings(at), tmp_path / IRL.folder, record.read))


def _lose(folder: Path) -> None:
    (folder / "gate.json").unlink()


def _forget(folder: Path) -> None:
    (folder / NOTE).unlink()


def _of_another(folder: Path) -> None:
    note = folder / NOTE
    note.write_text(note.read_text().replace(json.loads(note.read_text())["bytes"], "0" * 16))


def _break(folder: Path) -> None:
    (folder / NOTE).write_text('{"identity": ')


@pytest.mark.parametrize("damage", [_lose, _forget, _of_another, _break])
def test_only_what_the_note_names_of_these_bytes_may_be_missing(whole, tmp_path, damage):
    archive.unpack(whole, tmp_path)
    damage(tmp_path / IRL.folder)
    at = settings(tmp_path)
    found = standing(IRL, at)
    assert found.state == INCOMPLETE
    assert found.why[0].startswith("lost ")
    settle([IRL], at)
    assert not list((tmp_path / IRL.folder).glob("*.made"))
    assert len(list(faults(tmp_path))) >= 1


def test_who_needs_what_was_not_archived_is_told_in_one_line(whole, tmp_path, capsys):
    archive.unpack(whole, tmp_path)
    shown = tmp_path / SHOWN.folder / "demonstrations.parquet"
    assert cli.main([*learn_reward(shown), "--output", str(tmp_path / "own")]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert f"{shown}: was not archived; delete {shown.parent / NOTE}, and snakemake makes the run again" in line
    expert = tmp_path / SHOWN.expert.folder
    with pytest.raises(UserError, match=r"policy.safetensors: was not archived; delete .*archived.json"):
        storage.read_tensors(expert / "policy.safetensors")
    with pytest.raises(UserError, match="no such file; run the stage"):
        storage.read_tensors(expert / "other.safetensors")
    generator = tmp_path / IRL.folder / "policies" / "reach-t1.safetensors"
    with pytest.raises(UserError, match="was not archived"):
        storage.read_tensors(generator)


def test_a_run_that_is_made_again_loses_its_note(whole, tmp_path):
    archive.unpack(whole, tmp_path)
    at = settings(tmp_path)
    begin(Task(identity_of(IRL, at), IRL.settings(at), tmp_path / IRL.folder))
    assert not (tmp_path / IRL.folder / NOTE).exists()
    assert NOTE in NOT_RESULTS


def test_a_folder_that_holds_anything_is_left_alone(whole, tmp_path):
    begun, finished_run = STUDY.experts[0], STUDY.experts[1]
    storage.write_bytes(tmp_path / begun.folder / "checkpoint.safetensors", b"half a run")
    write(finished_run, settings(tmp_path))
    before = files(tmp_path)
    found = archive.unpack(whole, tmp_path)
    assert set(found.left_alone) == {begun.folder, finished_run.folder}
    assert before.items() <= files(tmp_path).items()
    assert not (tmp_path / begun.folder / FILE).exists()
    again = archive.unpack(whole, tmp_path)
    assert not again.restored


def test_a_folder_that_a_job_holds_or_fills_meanwhile_is_left_alone(whole, made, tmp_path, monkeypatch):
    with locked(tmp_path / IRL.folder):
        found = archive.unpack(whole, tmp_path)
    assert found.left_alone == (IRL.folder,)
    assert not (tmp_path / IRL.folder / FILE).exists()
    check = archive._taken
    monkeypatch.setattr(
        archive, "_taken", lambda folder: made_meanwhile(folder) if folder.name == "s0" else check(folder)
    )

    def made_meanwhile(folder):
        """Nothing is there at the first look; then a job ends."""
        if folder.relative_to(out) == Path(IRL.folder) and not folder.exists():
            shutil.copytree(made / IRL.folder, folder)
            return False
        return check(folder)

    out = tmp_path / "out"
    assert IRL.folder in archive.unpack(whole, out).left_alone
    assert files(out / IRL.folder) == files(made / IRL.folder)


def test_an_unpack_that_was_killed_goes_on(whole, tmp_path):
    archive.unpack(whole, tmp_path)
    before = files(tmp_path)
    (tmp_path / IRL.folder / FILE).unlink()
    (tmp_path / IRL.folder / "curve.csv").write_bytes(b"half")
    assert standing(IRL, settings(tmp_path)).state != DONE
    assert archive.unpack(whole, tmp_path).restored == (IRL.folder,)
    assert files(tmp_path) == before


# --- parts are only added ---------------------------------------------------------------------------------------------


def test_nothing_new_adds_nothing(copy, made):
    before = files(copy)
    assert add(copy, made) is None
    assert files(copy) == before


def test_a_run_made_again_is_a_new_part_and_replaces_the_old_one_in_reads(copy, made, tmp_path):
    before = files(copy)
    results = Path(shutil.copytree(made, tmp_path / "again"))
    curve = storage.read_csv(results / IRL.folder / "curve.csv")
    storage.remove(results / IRL.folder / FILE)
    storage.write_csv(results / IRL.folder / "curve.csv", curve.assign(value=curve["value"] + 1))
    sign(IRL, settings(results))
    assert add(copy, results) == copy / "part-0002"
    assert before.items() <= files(copy).items()
    found = archive.read(copy, "curve")
    assert len(found) == len(archive.read(copy, "curve").drop_duplicates())
    own = found[found["folder"] == IRL.folder]
    assert np.allclose(own["value"], curve["value"] + 1)
    archive.unpack(copy, tmp_path / "out")
    assert (tmp_path / "out" / IRL.folder / "curve.csv").read_bytes() == (
        results / IRL.folder / "curve.csv"
    ).read_bytes()
    readers = {run.folder for run in STUDY if IRL in run.needs.values()}
    wrong = archive.verify(copy)
    assert len(wrong) == len(readers) > 0
    for folder in readers:
        assert f"{copy}: {folder}: its reward had other bytes than the archive's {IRL.folder}" in wrong
    assert len(archive.read(copy, "evaluation")) == len(archive.read(copy, "evaluation").drop_duplicates())


def test_a_run_of_other_settings_replaces_none_unless_asked_to(copy, made, tmp_path, capsys):
    """The default archive is the reference study's: a forgotten --archive must not put smoke runs into it."""
    before, at = files(copy), settings(tmp_path / "other")
    other = at.model_copy(update={"sac": at.sac.model_copy(update={"discount": 0.9})})
    results = Path(shutil.copytree(made, tmp_path / "other"))
    run = SHOWN.expert
    shutil.rmtree(results / run.folder)
    write(run, other)
    with pytest.raises(
        UserError, match=r"another run than the archive's: sac\.discount: 0\.97 -> 0\.9; nothing was added"
    ):
        archive.add(copy, results, [run.folder], [])
    assert files(copy) == before
    assert archive.add(copy, results, [run.folder], [], replace=True) == copy / "part-0002"
    words = ["--archive", str(copy), "--settings", settings(tmp_path / "out").model_dump_json()]
    for action in ("unpack", "summary"):
        assert cli.main(["archive", action, *words]) == 0
        *_, last = capsys.readouterr().out.splitlines()
        assert last.startswith("1 of these are stale under the present settings and code, the first another run")


def test_an_archive_does_not_lie_among_runs(made, tmp_path):
    results = Path(shutil.copytree(made, tmp_path / "results"))
    for place in (results, results / IRL.folder):
        with pytest.raises(UserError, match="holds runs; name another folder for the archive"):
            archive.add(place, results, [IRL.folder], [])
        assert not list(place.glob("part-*"))


def test_policies_asked_for_later_are_added_once(copy, made):
    expert = SHOWN.expert.folder
    assert archive.add(copy, made, [expert], [expert]) == copy / "part-0002"
    assert archive.add(copy, made, [expert], [expert]) is None
    assert archive.add(copy, made, [expert], []) is None
    assert "policy.safetensors" in archive.archived(copy)[expert].kept


def test_a_restored_study_is_nothing_new(copy, tmp_path):
    archive.unpack(copy, tmp_path / "out")
    assert add(copy, tmp_path / "out") is None
    everything = [run.folder for run in STUDY]
    assert archive.add(copy, tmp_path / "out", everything, everything) is None


def test_a_run_that_is_no_longer_what_it_wrote_is_not_added(made, tmp_path):
    results = Path(shutil.copytree(made, tmp_path / "again"))
    for name in ("curve.csv", "reward.safetensors", "gate.json"):
        path, kept = results / IRL.folder / name, (results / IRL.folder / name).read_bytes()
        path.write_bytes(kept[:-2] + bytes([kept[-2] ^ 1]) + kept[-1:])
        with pytest.raises(UserError, match=rf"{name}: changed since its run wrote it"):
            add(tmp_path / "archive", results)
        path.write_bytes(kept)
    storage.remove(results / IRL.folder / "curve.csv")
    with pytest.raises(UserError, match="no finished run"):
        add(tmp_path / "archive", results)
    assert archive.parts(tmp_path / "archive") == []


def test_a_csv_that_would_not_come_back_is_not_added(made, tmp_path):
    results = Path(shutil.copytree(made, tmp_path / "again"))
    path = results / IRL.folder / "curve.csv"
    storage.remove(results / IRL.folder / FILE)
    path.write_text(path.read_text().replace(",0.7", ",0.70", 1))
    sign(IRL, settings(results))
    with pytest.raises(UserError, match=r"nothing was added: .*curve.csv: is not what its run wrote"):
        add(tmp_path / "archive", results)
    assert archive.parts(tmp_path / "archive") == []


def test_a_file_of_an_unknown_kind_is_not_added(made, tmp_path):
    results = Path(shutil.copytree(made, tmp_path / "again"))
    storage.remove(results / IRL.folder / FILE)
    storage.write_text(results / IRL.folder / "own.txt", "x")
    sign(IRL, settings(results))
    with pytest.raises(UserError, match=r"own\.txt: no kind of file that the archive knows"):
        add(tmp_path / "archive", results)


# --- damage -----------------------------------------------------------------------------------------------------------


def _places(size: int) -> list[int]:
    return sorted({0, size // 3, size // 2, size - 5, size - 1})


def test_a_flipped_bit_anywhere_is_found_and_refused(copy, tmp_path):
    part = copy / "part-0001"
    for path in sorted(part.iterdir()):
        whole = path.read_bytes()
        for place in _places(len(whole)):
            path.write_bytes(whole[:place] + bytes([whole[place] ^ 4]) + whole[place + 1 :])
            assert archive.verify(copy), (path.name, place)
            with pytest.raises(UserError):
                archive.read(copy, "evaluation")
            with pytest.raises(UserError):
                archive.unpack(copy, tmp_path / "out")
        path.write_bytes(whole)
    assert not (tmp_path / "out").exists()
    assert archive.verify(copy) == []


DAMAGE: dict[str, Callable[[Path], object]] = {
    "a lost frame": lambda part: (part / "curve.parquet").unlink(),
    "a lost manifest": lambda part: (part / "manifest.json").unlink(),
    "a foreign file": lambda part: (part / "more.parquet").write_bytes(b"x"),
    "a manifest of nothing": lambda part: (part / "manifest.json").write_text("{}"),
    "a lost part": lambda part: part.rename(part.with_name("part-0002")),
}


@pytest.mark.parametrize("what", DAMAGE)
def test_other_damage_is_found(copy, what, capsys):
    DAMAGE[what](copy / "part-0001")
    assert len(archive.verify(copy)) == 1
    assert cli.main(["archive", "verify", "--archive", str(copy)]) == 2
    printed = capsys.readouterr()
    assert printed.err == f"mtcsirl: {copy}: 1 faults\n"


@pytest.mark.parametrize(
    ("frame", "column", "said"),
    [
        ("curve", "value", "curve.csv: is not what its run wrote"),
        ("files", "sha256", "another checksum than in its identity"),
        ("texts", "content", "does not fit its own hash|is not what its run wrote|no rows of an archive"),
        ("weights", "rest", "is not what its run wrote"),
    ],
)
def test_a_part_that_was_edited_with_its_manifest_does_not_fit_its_identities(copy, frame, column, said):
    part = copy / "part-0001"
    path = part / f"{frame}.parquet"
    rows = storage.read_parquet(path)
    value = rows.at[1, column]
    edits = {float: lambda: value + 1, str: lambda: value.replace("1", "2"), bytes: lambda: value[:-1] + b"!"}
    rows.at[1, column] = edits[float if isinstance(value, float) else type(value)]()
    storage.write_parquet(path, rows)
    manifest = storage.read_json(part / "manifest.json")
    manifest["files"][path.name] = storage.checksum(path)
    storage.write_json(part / "manifest.json", manifest)
    wrong = archive.verify(copy)
    assert len(wrong) == 1
    assert pd.Series(wrong).str.contains(said).all()


# --- the verb ---------------------------------------------------------------------------------------------------------


def test_the_verb_adds_verifies_restores_and_counts(made, tmp_path, capsys):
    results = Path(shutil.copytree(made, tmp_path / "made"))
    overlay = tmp_path / "own.json"
    overlay.write_text(settings(results).model_dump_json())
    where = ["--archive", str(tmp_path / "reference"), "--settings", str(overlay)]
    count = len(list(STUDY))
    assert cli.main(["archive", "add", *where]) == 0
    assert f"{count} of {count} runs are done; {tmp_path / 'reference' / 'part-0001'}" in capsys.readouterr().out
    assert cli.main(["archive", "add", *where]) == 0
    assert "nothing new to add" in capsys.readouterr().out
    assert cli.main(["archive", "verify", *where]) == 0
    assert f"{count} runs; every kept file is what its run wrote" in capsys.readouterr().out
    assert cli.main(["archive", "unpack", *where, "--set", f"results={tmp_path / 'out'}"]) == 0
    assert f"{count} of {count} runs restored" in capsys.readouterr().out
    assert {status.state for status in study_status(STUDY, settings(tmp_path / "out"))} == {DONE}
    assert cli.main(["archive", "summary", *where]) == 0
    assert f"train_sac{'':15}    1 of 1 runs" in capsys.readouterr().out


def test_an_archive_that_is_not_there_is_one_line(tmp_path, capsys):
    for action in ("verify", "unpack", "summary"):
        assert cli.main(["archive", action, "--archive", str(tmp_path / "none")]) == 2
        assert capsys.readouterr().err == f"mtcsirl: {tmp_path / 'none'}: no archive there; `archive add` begins one\n"


def test_the_example_reads_it_without_the_package(whole):
    script = CHECKOUT / "examples" / "read_archive.py"
    text = script.read_text(encoding="utf-8")
    assert "mtcsirl" not in text
    assert len(text.splitlines()) < 40
    done = subprocess.run([sys.executable, str(script), str(whole)], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert f"{len(STUDY.irl_runs)} learned rewards; the first has" in done.stdout
    assert f"[{len(STUDY.transfers)} rows x 2 columns]" in done.stdout or STUDY.transfers[0].folder[:20] in done.stdout


def test_the_made_up_study_has_every_kind_of_file(made):
    """Else the tests above would pass for files that they never saw."""
    for run in STUDY:
        found = set(result_files(made / run.folder)) | {"provenance.json"}
        assert set(OUTPUTS[run.stage]) <= found, run.folder
        assert read_record(made / run.folder) is not None
    assert SCORE.experts
    assert SCORE.baselines
