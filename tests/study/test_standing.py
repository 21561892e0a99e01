"""Markers are a workflow's view of what stands in folders: whoever plans rewrites them, a job leaves them alone."""

from collections.abc import Callable
from pathlib import Path

import pytest

from mtcsirl.files import storage
from mtcsirl.files.identity import CHECKPOINT, marker, write_marker
from mtcsirl.irl import run
from mtcsirl.settings import Settings
from mtcsirl.stages import running
from mtcsirl.study import artefacts
from mtcsirl.study.artefacts import not_rendered, record_folder, settle_artefacts, sign_artefact
from mtcsirl.study.design import design
from mtcsirl.study.standing import settle
from tests.study.made_up import finish

Settle = Callable[[bool], dict[str, str]]
DONE, LOST = "figure_1", "table_5"
"""Two pages that show no run."""


def markers(folder: Path) -> set[str]:
    """The markers in a folder."""
    return {path.name for path in folder.glob(marker("*"))}


@pytest.fixture
def runs(settings: Settings) -> tuple[Path, Path, Settle]:
    """The folder of a run that is done and has no marker, of a stale one that has it, and what settles both."""
    done, stale = design(settings).baselines[:2]
    finish(done, settings)
    finish(stale, settings, steps=123)
    folders = [Path(settings.results) / run.folder for run in (done, stale)]
    return *folders, lambda mark: settle([done, stale], settings, mark=mark)


@pytest.fixture
def pages(settings: Settings) -> tuple[Path, Path, Settle]:
    """The same of two pages; the stale one lost its file."""
    for name in (DONE, LOST):
        file = Path(settings.results) / name
        storage.write_text(file, "drawn")
        sign_artefact(name, settings, [file])
    file.unlink()
    done, lost = (record_folder(name, settings.results) for name in (DONE, LOST))
    write_marker(done, None)
    return done, lost, lambda mark: settle_artefacts([DONE, LOST], settings, mark=mark)


@pytest.fixture(params=["runs", "pages"])
def found(request: pytest.FixtureRequest) -> tuple[Path, Path, Settle, list[str]]:
    """Both with false markers, and the hashes that they must have."""
    done, stale, settled = request.getfixturevalue(request.param)
    wanted = list(settled(False).values())
    write_marker(stale, wanted[1])
    return done, stale, settled, wanted


def test_whoever_plans_marks_what_is_done_and_nothing_else(found: tuple[Path, Path, Settle, list[str]]) -> None:
    done, stale, settled, wanted = found
    assert list(settled(True).values()) == wanted
    assert markers(done) == {marker(wanted[0])}
    assert markers(stale) == set()


def test_a_page_with_other_bytes_than_were_signed_is_made_again(pages: tuple[Path, Path, Settle]) -> None:
    """As `mtcsirl verify` sees it: else nothing would ever mend what the report refuses."""
    done, _, settled = pages
    settled(True)
    assert markers(done)
    (done.parents[1] / DONE).write_text("draws")
    settled(True)
    assert markers(done) == set()
    (done.parents[1] / DONE).write_text("drawn")
    settled(True)
    assert markers(done)


def test_a_damaged_picture_of_another_machine_is_none(settings: Settings, monkeypatch: pytest.MonkeyPatch) -> None:
    """Where nothing can be rendered, such a picture stays only while it is whole."""
    picture = Path(settings.results) / "figure_8.png"
    storage.write_text(picture, "drawn")
    monkeypatch.setattr(artefacts, "lacking", lambda: None)
    sign_artefact("figure_8", settings, [picture])
    monkeypatch.setattr(artefacts, "lacking", lambda: "no OSMesa")
    assert not_rendered("figure_8", settings) is None
    picture.write_text("damaged")
    assert not_rendered("figure_8", settings) == "no OSMesa"


def test_a_job_that_reads_the_workflow_touches_no_marker(found: tuple[Path, Path, Settle, list[str]]) -> None:
    """A marker that is there, of a run that another job makes at this moment, may be newer than what was planned."""
    done, stale, settled, wanted = found
    assert list(settled(False).values()) == wanted
    assert markers(done) == set()
    assert markers(stale) == {marker(wanted[1])}


def test_a_run_that_is_done_loses_its_checkpoint_and_any_other_keeps_it(runs: tuple[Path, Path, Settle]) -> None:
    done, stale, settled = runs
    for folder in (done, stale):
        storage.write_text(folder / CHECKPOINT, "of a run that was killed after its record was written")
    settled(False)
    assert (done / CHECKPOINT).is_file()
    settled(True)
    assert not (done / CHECKPOINT).exists()
    assert (stale / CHECKPOINT).is_file()


def test_a_checkpoint_has_one_name() -> None:
    assert {CHECKPOINT} == {running.CHECKPOINT, run.CHECKPOINT}
