"""Where the verbs that read a study write: never into a run, and what they replace at home is noted."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import pytest

from mtcsirl import cli
from mtcsirl.commands.signing import note
from mtcsirl.errors import UserError
from mtcsirl.files import storage
from mtcsirl.files.identity import FILE, read_record
from mtcsirl.settings import EvaluationSettings, Settings
from mtcsirl.study.artefacts import artefact_standing, record_folder
from mtcsirl.study.design import variants
from mtcsirl.study.folders import Named, begin, check_without_run
from mtcsirl.study.outputs import OUTPUTS
from mtcsirl.study.standing import DONE
from tests.results.made_up import write_run

ABLATION = "ablation_observation"
READERS = [
    ["table", "5"],
    ["figure", "s1"],
    ["ablation", ABLATION],
    ["reward-quality"],
    ["reward-preference"],
    ["diagnostics"],
    ["claims"],
    ["results"],
    ["report"],
]
WRITERS = [
    *([*verb, "--partial", "--output"] for verb in READERS),
    ["ablation", ABLATION, "--partial", "--output", "mine", "--figures"],
    ["validate", "--output"],
    ["validate", "--output", "mine", "--figures"],
]


@pytest.fixture
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An empty working folder."""
    monkeypatch.chdir(tmp_path)
    return tmp_path


def contents(folder: Path) -> dict[str, bytes]:
    """Every file below a folder."""
    return {str(path.relative_to(folder)): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


def finished(folder: Path, stage: str = "learn_reward") -> None:
    """The files of a run, without its record, as of a copy."""
    for name in OUTPUTS[stage]:
        storage.write_text(folder / name, name)


def begun(folder: Path) -> None:
    """A run that was killed at its first checkpoint."""
    begin(folder, Named("learn_reward", {"seed": 0}))
    for name in ("curve.csv", "diagnostics.csv", "checkpoint.safetensors"):
        storage.write_text(folder / name, name)


@pytest.mark.parametrize("verb", WRITERS, ids=" ".join)
@pytest.mark.parametrize("state", [finished, begun])
def test_a_run_is_left_alone(
    verb: list[str], state: Callable[[Path], None], here: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    state(here / "run")
    before = contents(here)
    assert cli.main([*verb, "run"]) == 2
    error = capsys.readouterr().err
    assert error.startswith("mtcsirl: run: ")
    assert error.endswith("choose a folder of its own\n")
    assert error.count("\n") == 1
    assert contents(here) == before, "nothing is replaced, and nothing is added"


def test_neither_a_folder_below_a_run_nor_one_that_is_home_there(
    here: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    begun(here / "run")
    before = contents(here)
    for words in (["--output", "run/mine"], ["--set", "results=run"]):
        assert cli.main(["diagnostics", "--partial", *words]) == 2
        assert "a run stands or was begun in" in capsys.readouterr().err
    assert contents(here) == before


@pytest.mark.parametrize("place", ["run/s0.png", "run/policies/s0.png"])
def test_no_single_file_joins_a_run(place: str, here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    begun(here / "run")
    before = contents(here)
    assert cli.main(["draw-diagnostics", "--run", "run", "--output", place]) == 2
    assert capsys.readouterr().err.endswith(f"{place}: a run's folder; choose a place outside of it\n")
    assert contents(here) == before
    assert cli.main(["draw-diagnostics", "--run", "run", "--output", "s0.png"]) == 2
    assert "s0.png" not in capsys.readouterr().err, "it is the run that is no good"


def test_a_figure_is_no_text(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    before = contents(here)
    assert cli.main(["draw-diagnostics", "--run", "run", "--output", "s0.txt"]) == 2
    assert "--output s0.txt: a figure is written as .png and .pdf; name one of them" in capsys.readouterr().err
    assert contents(here) == before


def test_nothing_is_no_folder_to_verify(capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["verify", ""]) == 2
    assert "must not be empty" in capsys.readouterr().err


def test_a_single_file_replaces_none_that_is_named_as_a_runs(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    finished(here / "copy")
    assert cli.main(["draw-diagnostics", "--run", "copy", "--output", "copy/reward.json"]) == 2
    assert "copy/reward.json: a run's folder" in capsys.readouterr().err


@pytest.mark.parametrize("stage", OUTPUTS)
def test_a_run_of_any_stage_is_known_by_its_files(stage: str, here: Path) -> None:
    finished(here / "run", stage)
    with pytest.raises(UserError, match="run: holds another run"):
        check_without_run(here / "run")


def test_a_folder_of_ones_own_takes_what_several_verbs_write(here: Path) -> None:
    """Runs have files of these names too."""
    for name in ("evaluation.csv", "diagnostics.csv", "curve.csv", "notes.md", "checkpoint.txt"):
        storage.write_text(here / "mine" / name, "mine")
    storage.write_text(here / "checkpoint.safetensors", "of something else, in the working folder")
    for _ in range(2):
        assert cli.main(["diagnostics", "--partial", "--output", "mine"]) == 0
    assert cli.main(["reward-quality", "--partial", "--output", "mine"]) == 0
    assert (here / "mine" / "diagnostics.csv").read_text() != "mine"
    assert (here / "mine" / "evaluation.csv").read_text() == "mine"


class Study(NamedTuple):
    """Experts of an ablation, all done."""

    settings: Settings
    words: list[str]
    csv: Path
    png: Path

    def draw(self, *words: str) -> int:
        """Call the verb."""
        return cli.main(["ablation", ABLATION, *self.words, *words])

    def state(self) -> str:
        """What the record says."""
        return artefact_standing(ABLATION, self.settings).state


@pytest.fixture
def study(tmp_path: Path) -> Study:
    """An ablation that the verb has drawn in full."""
    results, figures = tmp_path / "results", tmp_path / "figures"
    settings = Settings(
        results=str(results),
        figures=str(figures),
        ablations={"tasks": ("reach-wall",), "seeds": (0,)},
        evaluation=EvaluationSettings(episodes=2),
    )
    for one in variants(settings, ABLATION).values():
        for run in one.experts:
            write_run(run, settings, lambda agent: {"velocity": 0.7})
    words = ["--settings", json.dumps(settings.model_dump(mode="json"))]
    found = Study(settings, words, results / f"ablations/{ABLATION}.csv", figures / f"{ABLATION}.png")
    assert found.draw() == 0
    return found


def test_the_record_of_an_ablation_signs_its_table_and_its_pictures(
    study: Study, capsys: pytest.CaptureFixture[str]
) -> None:
    assert study.state() == DONE
    record = read_record(record_folder(ABLATION, study.settings.results))
    assert record is not None
    assert {Path(name).name for name in record.files} == {f"{ABLATION}.{ending}" for ending in ("csv", "pdf", "png")}
    assert cli.main(["verify", study.settings.results]) == 0
    study.png.write_bytes(b"damaged")
    assert cli.main(["verify", study.settings.results]) == 2
    assert f"{ABLATION}.png changed since" in capsys.readouterr().out


def test_an_ablation_that_goes_elsewhere_takes_its_pictures_along(study: Study, tmp_path: Path) -> None:
    before = study.png.read_bytes(), study.csv.read_bytes()
    assert study.draw("--partial", "--output", str(tmp_path / "elsewhere")) == 0
    names = {path.name for path in (tmp_path / "elsewhere").iterdir()}
    assert names == {f"{ABLATION}.{ending}" for ending in ("csv", "pdf", "png")}
    assert (study.png.read_bytes(), study.csv.read_bytes()) == before
    assert study.state() == DONE


@pytest.mark.parametrize(
    "words",
    [
        ["--partial"],
        ["--partial", "--output", "ELSEWHERE", "--figures", "FIGURES"],
        ["--partial", "--figures", "ELSEWHERE"],
        ["--output", "ELSEWHERE", "--figures", "FIGURES"],
    ],
    ids=" ".join,
)
def test_where_a_part_of_an_ablation_is_written_at_home_its_record_goes(
    words: list[str], study: Study, tmp_path: Path
) -> None:
    places = {"ELSEWHERE": str(tmp_path / "elsewhere"), "FIGURES": study.settings.figures}
    assert study.draw(*(places.get(word, word) for word in words)) == 0
    assert not (record_folder(ABLATION, study.settings.results) / FILE).exists()
    assert study.state() != DONE


def test_what_the_rule_of_an_ablation_calls_is_signed(study: Study) -> None:
    record = record_folder(ABLATION, study.settings.results) / FILE
    record.unlink()
    assert study.draw("--output", str(study.csv.parent), "--figures", str(study.png.parent)) == 0
    assert study.state() == DONE


def test_a_report_of_a_part_is_no_report_of_the_study(here: Path) -> None:
    settings = Settings(results="results", figures="figures")
    page = here / "results/report/index.html"
    storage.write_text(page, "whole")
    home = page.parent
    note("report", settings, [(home, home)], partial=False, files=page.name)
    assert artefact_standing("report", settings).state == DONE
    note("report", settings, [(here / "elsewhere", home)], partial=True, files=page.name)
    assert artefact_standing("report", settings).state == DONE
    note("report", settings, [(home, home)], partial=True, files=page.name)
    assert artefact_standing("report", settings).state != DONE


def test_a_note_speaks_of_the_files_of_its_artefact_alone(here: Path) -> None:
    settings = Settings(results="results", figures="figures")
    for name in ("table_5.csv", "table_1.csv"):
        storage.write_text(here / "results/tables" / name, name)
    home = Path("results/tables")
    note("table_5", settings, [(home, home)], partial=False)
    record = read_record(record_folder("table_5", "results"))
    assert record is not None
    assert list(record.files) == ["../../tables/table_5.csv"]
