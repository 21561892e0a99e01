"""Runs of the archive that are drawn, made again and compared."""

import shutil
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pandas as pd
import pytest

from mtcsirl import cli
from mtcsirl.errors import UserError
from mtcsirl.files import storage
from mtcsirl.files.identity import FILE, NOTE, checksum, dumps, read_record
from mtcsirl.results import again, archive
from mtcsirl.settings import Settings
from mtcsirl.study.keys import identity_of
from tests.results.small_study import IRL, SCORED, STUDY, settings, write

EXPERT, OTHER = "expert/velocity/push-back-t0/s0", IRL.demonstrations[0].expert.folder
BY_FOLDER = {run.folder: run for run in STUDY}


def test_a_draw_is_the_same_for_a_seed_and_another_for_another(whole: Path) -> None:
    known = archive.archived(whole)
    draws = [[run.folder for run in again.draw(known, STUDY, 3, 1, seed)] for seed in (0, 0, 1, 2, 3)]
    assert draws[0] == draws[1]
    assert len({tuple(drawn) for drawn in draws}) > 1
    for drawn in draws:
        stages = [BY_FOLDER[folder].stage for folder in drawn]
        assert len(set(drawn)) == 4
        assert [stage in again.AGENTS for stage in stages] == [True] * 3 + [False]
        assert stages[3] == "learn_reward"


def test_more_than_there_are_cannot_be_drawn(whole: Path) -> None:
    with pytest.raises(UserError, match=f"the archive holds {len(STUDY.irl_runs)} runs of learn_reward; draw at most"):
        again.draw(archive.archived(whole), STUDY, 1, 99, 0)


def test_what_was_not_kept_is_to_be_made_too(whole: Path) -> None:
    """Demonstrations always; their expert, unless its policy is kept; for a new agent nothing but itself."""
    known = archive.archived(whole)
    shown = {run.folder for run in IRL.demonstrations}
    experts = {run.expert.folder for run in IRL.demonstrations}
    assert again.to_be_made([IRL], known) == {IRL.folder} | shown | (experts - SCORED)
    assert again.to_be_made([BY_FOLDER[EXPERT]], known) == {EXPERT}
    new = STUDY.transfers[0]
    assert again.to_be_made([new], known) == {new.folder}
    without = {folder: run for folder, run in known.items() if folder != new.irl.folder}
    assert new.irl.folder in again.to_be_made([new], without)


def test_equal_bytes_and_others(whole: Path, tmp_path: Path) -> None:
    archive.unpack(whole, tmp_path)
    known = archive.archived(whole)
    assert again.compare(whole, known, tmp_path) == ((), ()), "restored runs were not made again"
    for folder, velocity in ((EXPERT, 0.7), (OTHER, 0.6)):
        shutil.rmtree(tmp_path / folder)
        write(BY_FOLDER[folder], settings(tmp_path), velocity)
    (same, other), left_out = again.compare(whole, known, tmp_path)
    assert left_out == ()
    assert (same.folder, same.other, same.apart) == (EXPERT, (), {})
    assert (other.folder, other.other) == (OTHER, ("curve.csv", "evaluation.csv", "gate.json"))
    assert other.apart["velocity"] == pytest.approx((0.7, 0.6), rel=0.2)


def of_other_settings(results: Path) -> Settings:
    at = settings(results)
    return at.model_copy(update={"sac": at.sac.model_copy(update={"discount": 0.9})})


def test_a_run_of_other_settings_is_listed_and_the_others_are_compared(whole: Path, tmp_path: Path) -> None:
    write(BY_FOLDER[EXPERT], of_other_settings(tmp_path))
    write(BY_FOLDER[OTHER], settings(tmp_path))
    found = again.compare(whole, archive.archived(whole), tmp_path)
    assert [one.folder for one in found.made] == [OTHER]
    assert found.left_out == ((EXPERT, "is another run than the archive's: sac.discount: 0.97 -> 0.9"),)


def _edit(folder: Path) -> None:
    path = folder / "curve.csv"
    path.write_text(path.read_text().replace("0.7", "0.8"))


def _lose(folder: Path) -> None:
    (folder / "policy.safetensors").unlink()


def _lose_provenance(folder: Path) -> None:
    (folder / "provenance.json").unlink()


def _break(folder: Path) -> None:
    (folder / FILE).write_text("{")


def _lead_out(folder: Path) -> None:
    record = read_record(folder)
    assert record is not None
    (folder / FILE).write_text(dumps(replace(record, files={**record.files, "../../../away.json": "0" * 64})))


UNMADE: dict[Callable[[Path], None], str] = {
    _edit: "curve.csv changed since its run wrote it",
    _lose: "lacks policy.safetensors",
    _lose_provenance: "lacks provenance.json",
    _break: "not a readable identity",
    _lead_out: "'../../../away.json' is no file that its stage leaves",
}


@pytest.mark.parametrize("damage", UNMADE)
def test_only_whole_and_unchanged_runs_count_as_made_again(whole: Path, tmp_path: Path, damage) -> None:
    for folder in (EXPERT, OTHER):
        write(BY_FOLDER[folder], settings(tmp_path))
    damage(tmp_path / EXPERT)
    made, ((folder, why),) = again.compare(whole, archive.archived(whole), tmp_path)
    assert [one.folder for one in made] == [OTHER]
    assert folder == EXPERT
    assert UNMADE[damage] in why


def test_restored_runs_without_their_notes_were_not_made_again(whole: Path, tmp_path: Path) -> None:
    """Neither those that lack what was not kept nor those of which everything is there."""
    archive.unpack(whole, tmp_path)
    for note in tmp_path.rglob(NOTE):
        note.unlink()
    found = again.compare(whole, archive.archived(whole), tmp_path)
    assert found.made == ()
    assert len(found.left_out) == len(BY_FOLDER)
    said = dict(found.left_out)
    assert said[EXPERT] == "was restored, not made again: its provenance.json is the archive's"
    assert said[OTHER].startswith("lacks policy.safetensors")


@pytest.mark.parametrize("drawn", [EXPERT, IRL.folder, STUDY.transfers[0].folder])
def test_runs_that_cannot_be_compared_are_not_drawn(whole: Path, tmp_path: Path, drawn: str) -> None:
    """Whether the drawn run is another or one that it comes from."""
    known = archive.archived(whole)
    again.refuse_others([BY_FOLDER[drawn]], known, settings(tmp_path))
    with pytest.raises(UserError, match=r"sac\.discount: 0\.97 -> 0\.9; take the settings, scale and code"):
        again.refuse_others([BY_FOLDER[drawn]], known, of_other_settings(tmp_path))


def test_the_verbs_refuse_and_list_other_runs(whole: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    other = of_other_settings(tmp_path / "again")
    words = ["--archive", str(whole), "--settings", other.model_dump_json()]
    assert cli.main(["archive", "draw", "--agents", "1", "--irl-runs", "0", *words]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert "is another run than the archive's: sac.discount: 0.97 -> 0.9" in line
    assert not (tmp_path / "again").exists()
    assert cli.main(["archive", "draw", "--agents", "99", *words]) == 2
    assert capsys.readouterr().out == "no-such-run\n", "nothing to ask for would be the whole study"
    write(BY_FOLDER[EXPERT], other)
    assert cli.main(["archive", "compare", *words]) == 2
    said = capsys.readouterr()
    assert f"{EXPERT}: not compared: is another run" in said.out
    assert "no archived run was made again there" in said.err
    write(BY_FOLDER[OTHER], settings(tmp_path / "again"))
    assert cli.main(["archive", "compare", *words]) == 0
    assert "1 of 1 runs have the archive's bytes; 1 not compared" in capsys.readouterr().out


def test_the_verbs(whole: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    at = settings(tmp_path / "again")
    words = ["--archive", str(whole), "--settings", at.model_dump_json()]
    draw = ["archive", "draw", "--agents", "1", "--irl-runs", "0", *words]
    assert cli.main(draw) == 0
    said = capsys.readouterr()
    (asked,) = said.out.splitlines()
    drawn = BY_FOLDER[str(Path(asked).parent.relative_to(at.results))]
    assert Path(asked).name == f".{identity_of(drawn, at).hash}.made"
    assert "1 runs to make, 1 drawn" in said.err
    assert not (Path(at.results) / drawn.folder).exists()
    others = [run for run in STUDY if run != drawn]
    assert all((Path(at.results) / run.folder / NOTE).is_file() for run in others)
    assert cli.main(["archive", "compare", *words]) == 2
    assert "no archived run was made again there" in capsys.readouterr().err
    write(drawn, at)
    assert cli.main(["archive", "compare", *words]) == 0
    said = capsys.readouterr().out
    assert f"{drawn.folder}: " in said
    assert "1 of 1 runs have the archive's bytes" in said
    assert (Path(at.results) / drawn.folder / FILE).is_file()
    assert cli.main(draw) == 2
    assert "is there; choose a folder without it" in capsys.readouterr().err


def rewritten(folder: Path, change: Callable[[pd.DataFrame], pd.DataFrame]) -> None:
    """An evaluation of another kind, of which the record knows."""
    rows = change(storage.read_csv(folder / "evaluation.csv"))
    storage.remove(folder / "evaluation.csv")
    storage.write_csv(folder / "evaluation.csv", rows)
    record = read_record(folder)
    assert record is not None
    files = dict(record.files) | {"evaluation.csv": checksum(folder / "evaluation.csv")}
    (folder / FILE).write_text(dumps(replace(record, files=files)))


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (lambda rows: rows.drop(columns="policy"), "its evaluation.csv has no numbers for policy"),
        (lambda rows: rows.iloc[:0], "its evaluation.csv has no numbers for success"),
        (lambda rows: rows[rows["metric"] != "velocity"], "its evaluation.csv has no numbers for velocity"),
    ],
)
def test_an_evaluation_of_another_kind_is_listed(
    change: Callable[[pd.DataFrame], pd.DataFrame], says: str, whole: Path, tmp_path: Path
) -> None:
    write(BY_FOLDER[EXPERT], settings(tmp_path))
    rewritten(tmp_path / EXPERT, change)
    found = again.compare(whole, archive.archived(whole), tmp_path)
    assert found.made == ()
    ((folder, why),) = found.left_out
    assert folder == EXPERT
    assert why.startswith(says)
