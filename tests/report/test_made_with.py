"""The results page says where its runs were made."""

from mtcsirl.files import storage
from mtcsirl.files.identity import FILE
from mtcsirl.report.results_page import made_with
from tests.results.small_study import STUDY, settings, write


def test_the_page_names_the_commits_and_machines_of_its_runs(tmp_path):
    """Each once, of the runs that are done; never those of the machine that writes the page."""
    at = settings(tmp_path)
    done = list(STUDY)[:3]
    for run, commit in zip(done, ("aaa", "bbb", "aaa"), strict=True):
        write(run, at)
        machine = {"processor": "Some | CPU", "cores": 64, "openblas": "Zen", "system": "Linux", "python": "3.11.1"}
        storage.write_json(tmp_path / run.folder / "provenance.json", {"commit": commit, "machine": machine})
    found = made_with(STUDY, at)
    assert found == {
        "commit": "aaa, bbb",
        "processor": "Some / CPU",
        "cores": "64",
        "openblas": "Zen",
        "system": "Linux",
        "python": "3.11.1",
    }
    for said in ([], {"commit": None}, {"machine": 7}):
        storage.write_json(tmp_path / done[1].folder / "provenance.json", said)
        assert made_with(STUDY, at)["commit"] == "aaa, unknown"
    (tmp_path / done[2].folder / FILE).unlink()
    assert made_with(STUDY, at)["cores"] == "64, unknown", "a run that is not done says nothing"


def test_the_page_of_no_run_names_no_machine(tmp_path):
    assert set(made_with(STUDY, settings(tmp_path)).values()) == {"–"}
