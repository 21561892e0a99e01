"""Demonstrations as Minari's own reader sees them."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from mtcsirl.cli import main
from mtcsirl.errors import UserError
from mtcsirl.exports.minari import export_minari
from mtcsirl.files import storage

minari = pytest.importorskip("minari", reason="pip install 'mtcsirl[export]'")
EPISODES, STEPS = 2, 5


@pytest.fixture
def demonstrations(tmp_path: Path) -> Path:
    random = np.random.default_rng(0)
    positions = random.normal(size=(EPISODES, STEPS + 1, 39)).astype(np.float32)
    rows = [
        {
            "observation": positions[episode, step],
            "action": random.uniform(-1, 1, 4).astype(np.float32),
            "next_observation": positions[episode, step + 1],
            "task_reward": float(step),
            "task": "reach",
            "target": 3,
            "cs_reward": "velocity",
            "episode": episode,
            "step": step,
            "success": step == STEPS - 1,
        }
        for episode in range(EPISODES)
        for step in range(STEPS)
    ]
    storage.write_parquet(tmp_path / "demonstrations.parquet", pd.DataFrame(rows))
    return tmp_path / "demonstrations.parquet"


def test_minari_reads_what_was_written(
    demonstrations: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("MINARI_DATASETS_PATH", "")
    options = ["--demonstrations", str(demonstrations), "--output", str(tmp_path / "datasets")]
    assert main(["export-demonstrations", *options]) == 0
    name = "mtcsirl/reach-t3-v0"
    assert capsys.readouterr().out.strip().endswith(name)
    dataset = minari.load_dataset(name)
    assert dataset.total_episodes == EPISODES
    frame = storage.read_parquet(demonstrations)
    for episode in dataset.iterate_episodes():
        own = frame[frame["episode"] == episode.id]
        np.testing.assert_array_equal(episode.observations[:-1], np.stack(own["observation"].to_list()))
        np.testing.assert_array_equal(episode.observations[-1], own["next_observation"].iloc[-1])
        np.testing.assert_array_equal(episode.actions, np.stack(own["action"].to_list()))
        np.testing.assert_array_equal(episode.rewards, own["task_reward"])
        assert episode.truncations.tolist() == [False] * (STEPS - 1) + [True]
        assert not episode.terminations.any()
        assert episode.infos["success"].tolist() == [False, *own["success"]]


def test_a_dataset_is_not_overwritten(demonstrations: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("MINARI_DATASETS_PATH", "")
    export_minari(demonstrations, tmp_path / "datasets")
    with pytest.raises(UserError, match="already holds mtcsirl/reach-t3-v0"):
        export_minari(demonstrations, tmp_path / "datasets")


@pytest.mark.parametrize(
    "name", ["foo", "bad name-v0", "ü/x-v0", "../out-v0", "/tmp/out-v0", "a//b-v0", "x-v", "", "x-v0/"]
)
def test_a_name_that_is_no_id_is_one_line_and_leaves_nothing(
    demonstrations: Path, tmp_path: Path, name: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("MINARI_DATASETS_PATH", "")
    folder = tmp_path / "datasets"
    options = ["--demonstrations", str(demonstrations), "--output", str(folder)]
    assert main(["export-demonstrations", *options, "--name", name]) == 2
    error = capsys.readouterr().err
    assert error.count("\n") == 1
    assert f"--name {name}: must be letters" in error
    assert not folder.exists()
    assert main(["export-demonstrations", *options, "--name", "mine/foo-v0"]) == 0, "the next correct call succeeds"
    assert (folder / "mine/foo-v0").is_dir()


def test_a_dataset_that_could_not_be_made_leaves_nothing(demonstrations: Path, tmp_path: Path) -> None:
    frame = storage.read_parquet(demonstrations)
    frame["action"] = [row[:2] if i % 2 else row for i, row in enumerate(frame["action"])]
    storage.write_parquet(demonstrations, frame)
    folder = tmp_path / "datasets"
    with pytest.raises(UserError, match="not readable as demonstrations"):
        export_minari(demonstrations, folder)
    assert not list(folder.rglob("*"))


FOREIGN = {
    "no task": ({"task": None}, "column task holds 'None', not a task of Meta-World"),
    "an unknown task": ({"task": "fly"}, "column task holds 'fly', not a task of Meta-World"),
    "no target": ({"target": np.nan}, "column target holds 'nan', not a target (0 ... 49)"),
    "a target too many": ({"target": 50}, "column target holds '50', not a target (0 ... 49)"),
    "a text as episode": ({"episode": "first"}, "column episode holds 'first', not a whole number"),
    "a text as success": ({"success": "False"}, "column success holds 'False', not true or false"),
    "no success": ({"success": None}, "column success holds 'None', not true or false"),
}


@pytest.mark.parametrize("what", FOREIGN)
def test_demonstrations_of_nothing_known_are_one_line_and_leave_nothing(
    demonstrations: Path, tmp_path: Path, what: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("MINARI_DATASETS_PATH", "")
    changes, says = FOREIGN[what]
    whole = storage.read_parquet(demonstrations)
    storage.write_parquet(demonstrations, whole.assign(**changes))
    words = ["export-demonstrations", "--demonstrations", str(demonstrations), "--output", str(tmp_path / "datasets")]
    assert main(words) == 2
    error = capsys.readouterr().err
    assert error.count("\n") == 1
    assert f"{demonstrations}: {says}; name the file demonstrations.parquet" in error
    assert not (tmp_path / "datasets").exists()
    storage.write_parquet(demonstrations, whole.assign(target=3.0, success=whole["success"].astype(float)))
    assert main(words) == 0, "numbers as a column with gaps has them are read"


def test_datasets_below_one_folder_are_all_found(
    demonstrations: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = tmp_path / "datasets"
    names = [export_minari(demonstrations, folder, name) for name in ("mine/a-v0", "mine/b-v0", "c-v0")]
    monkeypatch.setenv("MINARI_DATASETS_PATH", str(folder))
    assert set(names) <= set(minari.list_local_datasets())
