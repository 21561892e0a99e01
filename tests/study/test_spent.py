"""The plan held against runs that are done."""

from pathlib import Path

import pytest

from mtcsirl import cli
from mtcsirl.files import storage
from mtcsirl.settings import Settings
from mtcsirl.study.design import design
from mtcsirl.study.plan import cost
from mtcsirl.study.rates import load_rates
from mtcsirl.study.spent import ALONE, LOCKSTEP, spent
from tests.study.made_up import finish

RATES = load_rates()


def took(run, settings: Settings, share: float, lockstep: list[str]) -> None:
    """A run that is done and took ``share`` of what the plan says."""
    finish(run, settings)
    together = len(lockstep) or 1
    seconds = share * (cost(run, settings, RATES, together).seconds - RATES.start_up / together)
    provenance = {"cost": {"cpu_seconds": seconds}, "lockstep": lockstep, "machine": {"processor": "made up"}}
    storage.write_json(Path(settings.results) / run.folder / "provenance.json", provenance)


def test_by_stage_and_by_the_way_they_were_made(settings: Settings) -> None:
    study = design(settings)
    first, second, third = study.baselines[:3]
    took(first, settings, 0.5, [])
    took(second, settings, 0.7, [])
    took(third, settings, 0.2, ["reach-t0 s0", "reach-t0 s1"])
    alone, lockstep = spent(study, settings, RATES)
    assert (alone.stage, alone.made, alone.runs) == ("train_sac", ALONE, 2)
    assert 0.5 < alone.low < alone.ratio < alone.high < 0.7
    assert (lockstep.made, lockstep.runs) == (LOCKSTEP, 1)
    assert lockstep.ratio == lockstep.low == lockstep.high == pytest.approx(0.2)


def test_where_cores_are_busy_the_plan_says_more(settings: Settings) -> None:
    took(design(settings).baselines[0], settings, 1.0, [])
    busy = RATES.model_copy(update={"slowdown": 1.25})
    ratios = [spent(design(settings), settings, busy, cores)[0].ratio for cores in (1, 2)]
    assert ratios == pytest.approx([1.0, 0.8])


def test_what_is_stale_or_absent_says_nothing(settings: Settings) -> None:
    study = design(settings)
    took(study.baselines[0], settings, 0.5, [])
    finish(study.baselines[1], settings, steps=123)
    assert [line.runs for line in spent(study, settings, RATES)] == [1]


@pytest.mark.parametrize(
    ("provenance", "says"),
    [
        ({"commit": "x"}, "lacks lockstep"),
        ({"lockstep": 3, "cost": {"cpu_seconds": 1.0}, "machine": {"processor": "x"}}, "lockstep is '3', not a list"),
        (
            {"lockstep": [], "cost": {"cpu_seconds": "1"}, "machine": {"processor": "x"}},
            "cpu_seconds is '1', not a numb",
        ),
        ({"lockstep": [], "cost": {"cpu_seconds": 1.0}, "machine": []}, "lacks machine.processor"),
        ([], "lacks lockstep"),
    ],
)
def test_a_damaged_provenance_is_named(
    provenance: object, says: str, settings: Settings, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    first, second = design(settings).baselines[:2]
    took(first, settings, 0.5, [])
    took(second, settings, 0.5, [])
    path = Path(settings.results) / second.folder / "provenance.json"
    storage.write_json(path, provenance)
    file = tmp_path / "settings.json"
    file.write_text(settings.model_dump_json(), encoding="utf-8")
    assert cli.main(["plan", "--against-runs", "--settings", str(file)]) == 2
    error = capsys.readouterr().err
    assert error.startswith(f"mtcsirl: {path}: ")
    assert says in error
    assert error.endswith("; delete its folder and make it again\n")
    assert error.count("\n") == 1


def test_the_verb_prints_it_and_refuses_a_study_without_runs(
    settings: Settings, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    took(design(settings).baselines[0], settings, 0.5, [])
    file = tmp_path / "settings.json"
    file.write_text(settings.model_dump_json(), encoding="utf-8")
    assert cli.main(["plan", "--against-runs", "--cores", "1", "--settings", str(file)]) == 0
    said = capsys.readouterr().out
    assert " 0.50 " in said
    assert RATES.machine in said
    assert cli.main(["plan", "--against-runs", "--settings", str(file), "--set", f"results={tmp_path / 'none'}"]) == 2
    assert "no run is done" in capsys.readouterr().err
