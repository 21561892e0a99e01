"""What is in a folder belongs to somebody: a stage fills a new or empty one, or goes on where its run was begun."""

from pathlib import Path

import pytest

from mtcsirl import cli
from mtcsirl.errors import UserError
from mtcsirl.files import storage
from mtcsirl.files.identity import FILE, Identity, Record, checksums, dumps, marker
from mtcsirl.study.folders import BEGUN, Named, begin, check_folder, results_of
from mtcsirl.study.outputs import OUTPUTS
from tests.faults.command import CHANGES

KEY = {"task": "reach", "target": 0, "seed": 0}
SMALL = [word for key, value in CHANGES.items() if key != "steps" for word in ("--set", f"{key}={value}")]


def _contents(folder: Path) -> dict[str, str]:
    return {str(path.relative_to(folder)): path.read_text() for path in folder.rglob("*") if path.is_file()}


def _train(output: Path | str, seed: int = 0, steps: int = 600) -> int:
    words = ["--task", "reach", "--seed", str(seed), *SMALL, "--set", f"steps={steps}", "--output", str(output)]
    return cli.main(["train-sac", *words])


def _sign(folder: Path, stage: str = "train_sac", key: dict[str, object] = KEY) -> None:
    """A finished run of made-up files."""
    for name in OUTPUTS[stage]:
        storage.write_text(folder / name, name)
    record = Record(Identity(stage, key, {}, {}, {}), checksums(folder, results_of(folder, stage)))
    storage.write_text(folder / FILE, dumps(record))


STRANGERS = {
    "a document": (["docs/thesis.tex", "settings.json", "evaluation.csv"], "holds docs, which is of no run"),
    "settings of one's own": (["settings.json"], "holds settings.json, but no run that wrote it"),
    "an evaluation": (["evaluation.csv"], "holds evaluation.csv, but no run that wrote it"),
    "a hidden file": ([".bashrc"], "holds .bashrc, which is of no run"),
    "a document beside a record of somebody's": (["identity.json", "me.txt"], "holds me.txt, which is of no run"),
    "policies of one's own": (["policies/home.pdf"], "holds policies, which is of no run"),
}


@pytest.mark.parametrize("what", STRANGERS)
def test_a_folder_of_somebody_is_refused_and_left_alone(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], what: str
) -> None:
    files, says = STRANGERS[what]
    for name in files:
        storage.write_text(tmp_path / "mine" / name, "mine")
    before = _contents(tmp_path)
    assert _train(tmp_path / "mine") == 2
    error = capsys.readouterr().err
    assert error.count("\n") == 1
    assert f"{tmp_path / 'mine'}: {says}; name a new or an empty folder" in error
    assert _contents(tmp_path) == before


@pytest.mark.parametrize("place", ["/", ".", "src"])
def test_neither_the_disk_nor_the_checkout_is_a_run(
    place: str, capsys: pytest.CaptureFixture[str], checkout: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(checkout)
    assert _train(place) == 2
    assert "which is of no run" in capsys.readouterr().err


OF_A_RUN = {
    "nothing": [],
    "the log of a workflow": ["run.log", "run.1.log"],
    "a lock": [".lock"],
    "a checkpoint": ["checkpoint.safetensors", "curve.csv"],
    "a temporary": [".curve.csv.12.tmp"],
    "a marker": [marker("0" * 16), "curve.csv"],
    "a note of an archive": ["archived.json", "policy.json"],
    "a run that was begun": [BEGUN, "curve.csv"],
    "a run of an older version": ["provenance.json", "settings.json", "curve.csv"],
    "a damaged record": [FILE, "curve.csv"],
    "events of TensorBoard": ["events/one", "checkpoint.safetensors"],
}


@pytest.mark.parametrize("what", OF_A_RUN)
def test_what_a_run_leaves_is_in_nobodys_way(tmp_path: Path, what: str) -> None:
    for name in OF_A_RUN[what]:
        storage.write_text(tmp_path / name, "{")
    check_folder(tmp_path, "train_sac", KEY)


def test_a_folder_that_is_not_there_is_free(tmp_path: Path) -> None:
    check_folder(tmp_path / "new", "train_sac", KEY)


OTHERS = {
    "another seed": ("train_sac", KEY | {"seed": 1}),
    "another target": ("train_sac", KEY | {"target": 3}),
    "another stage with the same files": ("train_expert", KEY | {"cs_reward": "velocity"}),
}


@pytest.mark.parametrize("what", OTHERS)
@pytest.mark.parametrize("state", ["finished", "begun", "stale and begun again"])
def test_another_run_is_refused(tmp_path: Path, what: str, state: str) -> None:
    stage, key = OTHERS[what]
    if state == "finished":
        _sign(tmp_path, stage, key)
    else:
        begin(tmp_path, Named(stage, key))
        check_folder(tmp_path, "train_sac", KEY)  # nothing is lost yet
        storage.write_text(tmp_path / ("checkpoint.safetensors" if state == "begun" else "curve.csv"), "x")
    says = rf"holds another run, {stage} \(.*task reach\); choose a folder of its own"
    with pytest.raises(UserError, match=says) as caught:
        check_folder(tmp_path, "train_sac", KEY)
    assert "\n" not in str(caught.value)


def test_a_stale_run_of_the_same_key_is_made_again(tmp_path: Path) -> None:
    _sign(tmp_path)
    storage.write_text(tmp_path / "notes.md", "mine")
    check_folder(tmp_path, "train_sac", dict(reversed(KEY.items())))


def test_a_run_signs_what_its_stage_leaves_and_nothing_else(tmp_path: Path) -> None:
    for name in (*OUTPUTS["learn_reward"], "policies/reach-t1.json", "notes.md", "docs/thesis.tex", "events/one"):
        storage.write_text(tmp_path / name, name)
    own = {*OUTPUTS["learn_reward"], "policies/reach-t1.json"} - {"provenance.json"}
    assert set(results_of(tmp_path, "learn_reward")) == own
    assert "policies/reach-t1.json" not in results_of(tmp_path, "train_sac")


@pytest.mark.slow
def test_a_finished_run_outlives_a_mistyped_seed(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    run = tmp_path / "run"
    assert _train(run) == 0
    assert not (run / BEGUN).exists()
    before = {path.name: path.read_bytes() for path in run.iterdir()}
    capsys.readouterr()
    assert _train(run, seed=7) == 2
    assert "holds another run, train_sac (seed 0, target 0, task reach)" in capsys.readouterr().err
    assert {path.name: path.read_bytes() for path in run.iterdir()} == before
    storage.write_text(run / "notes.md", "mine")
    assert _train(run, steps=500) == 0
    assert "notes.md" not in (run / FILE).read_text()
