"""Demonstrations on disk and back."""

import numpy as np
import pandas as pd
import pytest
import torch

from mtcsirl.agents.sac import FusedSac
from mtcsirl.episodes.demonstrations import COLUMNS, collect_demonstrations, load_demonstrations
from mtcsirl.episodes.policy import Policy
from mtcsirl.errors import UserError
from mtcsirl.files.storage import write_parquet
from mtcsirl.rewards.ground_truth import velocity
from mtcsirl.settings import SacSettings
from mtcsirl.settings.runs import DemonstrationRunSettings
from mtcsirl.worlds.environments import OBSERVATION_MAPS

SETTINGS = DemonstrationRunSettings(episodes=2, episode_steps=20)


@pytest.fixture(scope="module")
def policy() -> Policy:
    return FusedSac(1, SacSettings(hidden_sizes=(8,)), seeds=[0]).policy(0)


@pytest.fixture(scope="module")
def frame(policy) -> pd.DataFrame:
    return collect_demonstrations(policy, "reach", 1, SETTINGS, seed=3)


def _file(folder, frame, name="demonstrations.parquet"):
    write_parquet(folder / name, frame)
    return folder / name


def test_rows_are_whole_episodes_of_one_task_in_order(frame) -> None:
    assert tuple(frame.columns) == COLUMNS
    assert frame["episode"].tolist() == [0] * 20 + [1] * 20
    assert frame["step"].tolist() == [*range(20), *range(20)]
    assert set(frame["task"]) == {"reach"}
    assert set(frame["target"]) == {1}
    for episode in (0, 20):
        after, following = frame["next_observation"][episode], frame["observation"][episode + 1]
        assert np.array_equal(after, following)
    assert np.array_equal(frame["observation"][0], frame["observation"][20])  # resets are identical
    assert not np.array_equal(frame["action"][0], frame["action"][20])  # the policy is stochastic
    assert frame["task_reward"].between(0, 10).all()


def test_same_seed_same_episodes(policy, frame) -> None:
    again = collect_demonstrations(policy, "reach", 1, SETTINGS, seed=3)
    pd.testing.assert_frame_equal(again, frame)


def test_loading_gives_what_the_agent_sees(tmp_path, frame) -> None:
    other = frame.assign(task="push-back")
    files = [_file(tmp_path, frame), _file(tmp_path, other, "other.parquet")]
    loaded = load_demonstrations(files, episodes=2, observation="mapped")
    assert loaded.members == (("reach", 1), ("push-back", 1))
    assert loaded.transitions.observation.shape == (2, 40, 39)
    assert loaded.transitions.task_reward.shape == (2, 40)
    raw = OBSERVATION_MAPS["mapped"].invert(loaded.transitions.observation[0])
    np.testing.assert_allclose(raw, np.stack(frame["observation"]), atol=1e-6)
    one = load_demonstrations(files, episodes=1, observation="raw").transitions
    assert torch.equal(one.next_observation[1], torch.from_numpy(np.stack(frame["next_observation"][:20])))
    assert velocity(one).max() < 1.5  # metres per second


def test_bad_files_are_one_clear_line(tmp_path, frame) -> None:
    def load(*files, episodes=2):
        return load_demonstrations(files, episodes=episodes, observation="mapped")

    good = _file(tmp_path, frame)
    with pytest.raises(UserError, match="has 2 episodes, 3 are asked for"):
        load(good, episodes=3)
    with pytest.raises(UserError, match="a second file for reach-t1"):
        load(good, good)
    with pytest.raises(UserError, match="no such file"):
        load(tmp_path / "none.parquet")
    with pytest.raises(UserError, match="lacks the column success"):
        load(_file(tmp_path, frame.drop(columns="success"), "a.parquet"))
    with pytest.raises(UserError, match="holds push-t1, reach-t1"):
        load(_file(tmp_path, pd.concat([frame, frame.assign(task="push")]), "b.parquet"))
    short = frame.assign(action=[row[:3] for row in frame["action"]])
    with pytest.raises(UserError, match="column action does not hold 4 finite numbers"):
        load(_file(tmp_path, short, "c.parquet"))
    broken = tmp_path / "d.parquet"
    broken.write_bytes(good.read_bytes()[:-100])
    with pytest.raises(UserError, match="not a readable Parquet file"):
        load(broken)
    with pytest.raises(UserError, match=r"\[20, 40\] transitions per task"):
        load(good, _file(tmp_path, _cut(frame), "e.parquet"))


def _cut(frame: pd.DataFrame) -> pd.DataFrame:
    """Another task with episodes of half the length."""
    return frame[frame["step"] < 10].assign(task="push-back")
