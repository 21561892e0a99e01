"""What lies in a results folder beside the study that the page names: left out, counted, and one line each."""

import json
import shutil
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import pytest

from mtcsirl import cli
from mtcsirl.errors import UserError
from mtcsirl.files import storage
from mtcsirl.files.identity import FILE
from mtcsirl.report.collect import collect
from mtcsirl.report.content import GateLine, ReportData
from mtcsirl.report.gate_lines import gate_lines
from mtcsirl.report.runs_there import Gate, Told
from mtcsirl.settings import Settings
from mtcsirl.study.artefacts import artefact_standing, record_folder
from mtcsirl.study.design import design
from mtcsirl.study.partial import NOTE
from mtcsirl.study.runs import AnyRun
from mtcsirl.study.standing import ABSENT, DONE
from tests.results.small_study import SEVERAL, sign_with_inputs, write

RUNS = [run for run in design(Settings(**SEVERAL)) if run.stage != "score_reward"]
"""Done in the study of these tests; its scores are not there yet."""
EXPERT = "expert/velocity/push-back-t0/s0"
MADE = (["claims"], ["table", "2"], ["table", "5"], ["figure", "s2"])
FILES = (
    "results/claims/claims.json",
    "results/tables/table_2.json",
    "results/tables/table_5.json",
    "figures/figure_s2.png",
)


class Study(NamedTuple):
    """A study of which a part is done."""

    root: Path

    def settings(self, **other: object) -> Settings:
        """Those that it was made with; ``other``: keys that are other ones now."""
        return Settings(**(SEVERAL | other), results=str(self.root / "results"), figures=str(self.root / "figures"))

    def call(self, *words: str, **other: object) -> int:
        """Call a verb with the settings."""
        given = self.settings(**other).model_dump(mode="json")
        return cli.main([*words, "--settings", json.dumps(given)])

    def data(self, **other: object) -> ReportData:
        """What a page of a part shows."""
        return collect(self.settings(**other), self.root / "page.html", partial=True)

    def run(self, folder: str) -> AnyRun:
        """A run by its folder."""
        return next(run for run in design(self.settings()) if run.folder == folder)

    def edit(self, file: str, change: Callable[[dict], object]) -> None:
        """Change JSON by hand."""
        said = json.loads((self.root / file).read_text())
        change(said)
        (self.root / file).write_text(json.dumps(said))


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Its folder, once."""
    study = Study(tmp_path_factory.mktemp("made"))
    for run in RUNS:
        write(run, study.settings())
    for verb in MADE:
        assert study.call(*verb, "--partial") == 0
    return study.root


@pytest.fixture
def study(made: Path, tmp_path: Path) -> Study:
    """A copy of one's own."""
    shutil.copytree(made, tmp_path / "study")
    return Study(tmp_path / "study")


def names(data: ReportData) -> list[str]:
    """The artefacts on a page."""
    return [view.name for view in (*data.tables, *data.figures)] + (["claims"] if data.claims else [])


def experts(data: ReportData) -> GateLine:
    """The gates of the experts of one task."""
    return next(line for line in data.gates if (line.gate, line.task) == ("expert", "push-back"))


def test_a_page_of_a_part_shows_all_that_was_made_of_it(study: Study, capsys: pytest.CaptureFixture[str]) -> None:
    data = study.data()
    assert names(data) == ["table_2", "table_5", "figure_s2", "claims"]
    assert data.cautions == ()
    assert sum(stage.done for stage in data.run.stages) == len(RUNS)
    assert {line.gate for line in data.gates} > {"expert", "SAC"}
    capsys.readouterr()
    assert study.call("report", "--partial") == 0
    assert capsys.readouterr().err == ""


@pytest.mark.parametrize("other", [{"sac": {"discount": 0.5}}, {"scale": "smoke", "sac": {"discount": 0.5}}])
def test_under_other_settings_nothing_that_was_made_before_is_shown(
    study: Study, other: dict[str, object], capsys: pytest.CaptureFixture[str]
) -> None:
    data = study.data(**other)
    assert names(data) == []
    assert data.gates == ()
    assert sum(stage.done for stage in data.run.stages) == 0
    assert sum(line.done for line in data.targets) == 0
    assert data.rows == {}
    assert data.cautions[0].startswith(f"{len(RUNS)} runs are stale and left out (first expert/velocity/")
    assert "sac.discount: 0.97 -> 0.5" in data.cautions[0]
    assert all(len(caution) < 500 for caution in data.cautions)
    capsys.readouterr()
    assert study.call("report", "--partial", **other) == 0
    said = capsys.readouterr()
    page = (study.root / "results/report/index.html").read_text()
    assert "data:image/png" not in page
    assert page.count('<p class="warning" role="note">') >= len(data.cautions)
    assert said.err.splitlines() == [f"mtcsirl: {caution}" for caution in data.cautions]


def test_settings_of_the_whole_study_count_for_what_no_run_knows(study: Study) -> None:
    """Verdicts of another scale, over the same runs."""
    data = study.data(scale="smoke")
    assert "claims" not in names(data)
    assert any("scale: desk -> smoke" in caution for caution in data.cautions)
    assert sum(stage.done for stage in data.run.stages) == len(RUNS), "runs are the same at any scale of this name"


def hand(said: dict) -> None:
    for claim in said["claims"]:
        claim["verdict"] = "reproduced"


@pytest.mark.parametrize("file", FILES)
def test_what_was_changed_by_hand_is_left_out(study: Study, file: str) -> None:
    path = study.root / file
    if file.endswith("claims.json"):
        study.edit(file, hand)
    else:
        path.write_bytes(path.read_bytes()[:-50])
    data = study.data()
    assert len(names(data)) == 3
    assert path.stem not in names(data)
    (caution,) = data.cautions
    assert f"{path.name} changed since it was written" in caution
    assert "Make it again" in caution
    assert "reproduced" not in [claim.verdict for claim in data.claims]


@pytest.mark.parametrize("file", FILES)
def test_what_nobody_noted_is_left_out(study: Study, file: str) -> None:
    (record_folder(Path(file).stem, study.root / "results") / NOTE).unlink()
    (caution,) = study.data().cautions
    assert "nothing says what it was made from" in caution


@pytest.mark.parametrize("text", ["", "{}", '{"format": 1}'])
def test_a_damaged_note_is_one_line(study: Study, text: str) -> None:
    (record_folder("claims", study.root / "results") / NOTE).write_text(text)
    (caution,) = study.data().cautions
    assert NOTE in caution
    assert "\n" not in caution


def test_a_lost_file_beside_the_first_counts(study: Study) -> None:
    (study.root / "figures/figure_s2.pdf").unlink()
    (caution,) = study.data().cautions
    assert caution.startswith("Left out: Figure S2 (lost figure_s2.pdf)")


def test_what_shows_a_run_that_is_no_longer_done_is_left_out(study: Study) -> None:
    """An expert, whose demonstrations all the others need; Table 5 shows no run."""
    (study.root / "results" / EXPERT / "curve.csv").unlink()
    data = study.data()
    assert names(data) == ["table_5"]
    assert data.cautions[0] == (
        f"1 run is damaged and left out ({EXPERT}: lost curve.csv): delete the folder of each and make it again "
        "(`mtcsirl verify` looks at every file)."
    )
    assert f"Left out: Table 2, Figure S2, Claims (made from other settings, code or runs: {EXPERT}" in data.cautions[1]


def test_what_shows_a_run_that_was_made_again_is_left_out(study: Study) -> None:
    sac = study.run("sac/push-back-t0/s0")
    write(sac, study.settings(), velocity=0.5)
    assert names(study.data()) == ["table_5"]


def test_what_is_older_than_its_runs_says_so(study: Study, made: Path, tmp_path: Path) -> None:
    """The verdicts were made before the expert was done."""
    early = tmp_path / "early"
    shutil.copytree(made / "results", early / "results", ignore=shutil.ignore_patterns("artefacts", "claims", "tables"))
    held = early / "held"
    (early / "results" / EXPERT).rename(held)
    demonstrations = early / "results/demonstrations/velocity/push-back-t0/s0"
    assert Study(early).call("table", "2", "--partial") == 0
    held.rename(early / "results" / EXPERT)
    assert demonstrations.is_dir()
    data = Study(early).data()
    assert names(data) == ["table_2"]
    (caution,) = data.cautions
    assert caution == (
        "Older than 1 of its runs: Table 2. Make it again with these settings, as by `mtcsirl table 2 --partial`."
    )
    assert Study(early).call("table", "2", "--partial") == 0
    assert Study(early).data().cautions == ()


@pytest.mark.parametrize(
    ("name", "change", "says"),
    [
        ("provenance.json", lambda said: [said.pop(name) for name in list(said) if name != "commit"], "lacks machine"),
        ("provenance.json", lambda said: said["cost"].update(cpu_seconds="long"), "cost.cpu_seconds is 'long', not"),
        ("provenance.json", lambda said: said["cost"].update(peak_memory_mib=True), "is 'True', not a number"),
        ("provenance.json", lambda said: said.update(versions=[]), "versions is '[]', not texts by name"),
        ("provenance.json", lambda said: said.update(commit={}), "commit is '{}', not a text"),
        ("gate.json", dict.clear, "gate.json: changed since its run wrote it"),
    ],
)
def test_a_damaged_run_is_counted_and_named(study: Study, name: str, change: Callable, says: str) -> None:
    whole = study.data()
    study.edit(f"results/{EXPERT}/{name}", change)
    data = study.data()
    assert sum(stage.done for stage in data.run.stages) == len(RUNS) - 1
    assert experts(data).agents == experts(whole).agents - 1
    (caution,) = data.cautions
    assert caution.startswith(f"1 run is damaged and left out ({EXPERT}: ")
    assert says in caution
    assert "\n" not in caution


@pytest.mark.parametrize(
    ("gate", "says"),
    [({}, "gate.json: lacks passed"), ({"passed": 1, "success": 1.0, "metric": None}, "passed is '1', not true or")],
)
def test_a_gate_that_is_none_is_damage_where_it_is_signed_and_no_run_where_not(
    study: Study, gate: dict[str, object], says: str
) -> None:
    folder = study.root / "results" / EXPERT
    storage.write_json(folder / "gate.json", gate)
    (folder / FILE).unlink()
    assert not [caution for caution in study.data().cautions if caution.startswith("1 run is damaged")]
    sign_with_inputs(study.run(EXPERT), study.settings())
    assert any(says in caution for caution in study.data().cautions)


def test_a_success_that_was_no_number_is_no_damage(study: Study) -> None:
    """A gate has null where a simulation diverged to what is no number."""
    folder, whole = study.root / "results" / EXPERT, study.data()
    study.edit(f"results/{EXPERT}/gate.json", lambda said: said.update(success=None, metric=None, passed=False))
    (folder / FILE).unlink()
    sign_with_inputs(study.run(EXPERT), study.settings())
    data = study.data()
    assert not [caution for caution in data.cautions if "damaged" in caution]
    assert experts(data).passed == experts(whole).passed - 1
    assert experts(data).agents == experts(whole).agents


def test_means_of_gates_are_of_numbers() -> None:
    first, second = design(Settings(**(SEVERAL | {"seeds": (0, 1)}))).baselines[:2]
    told = Told("c", "m", {}, 1.0, 1.0, (Gate("push-back", True, 1.0, None),))
    lost = replace(told, gates=(Gate("push-back", False, None, None),))
    (line,) = gate_lines({first: told, second: lost})
    assert (line.passed, line.agents, line.success, line.metric) == (1, 2, 1.0, None)


def test_a_page_of_the_whole_names_the_first_run_that_lacks(study: Study, capsys: pytest.CaptureFixture[str]) -> None:
    capsys.readouterr()
    assert study.call("report") == 2
    error = capsys.readouterr().err
    assert error.count("\n") == 1
    assert "this run is missing; make it with `snakemake" in error
    assert "or ask for --partial results" in error
    study.edit(f"results/{EXPERT}/provenance.json", dict.clear)
    with pytest.raises(UserError, match=rf"{EXPERT}: this run is damaged \(.*provenance\.json: lacks commit; delete"):
        collect(study.settings(), study.root / "page.html")


def test_what_is_made_of_the_whole_takes_the_note_of_a_part_away_and_back(study: Study) -> None:
    note = record_folder("table_5", study.root / "results") / NOTE
    assert note.is_file()
    assert artefact_standing("table_5", study.settings()).state == ABSENT, "no workflow takes it for done"
    assert study.call("table", "5") == 0
    assert not note.exists()
    assert artefact_standing("table_5", study.settings()).state == DONE
    assert "table_5" in names(study.data())
    assert study.call("table", "5", "--partial") == 0
    assert note.is_file()
    assert artefact_standing("table_5", study.settings()).state == ABSENT
    assert "table_5" in names(study.data())
