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
