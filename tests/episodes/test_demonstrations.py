"""Demonstrations on disk and back."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
import torch

from mtcsirl.agents.sac import FusedSac
from mtcsirl.episodes import demonstrations
from mtcsirl.episodes.demonstrations import (
    COLUMNS,
    collect_demonstrations,
    demonstrated,
    load_demonstrations,
    read_demonstrations,
    whole_episodes,
)
from mtcsirl.episodes.policy import Policy
from mtcsirl.errors import UserError
from mtcsirl.files.storage import write_parquet
from mtcsirl.rewards.ground_truth import velocity
from mtcsirl.settings import SacSettings
from mtcsirl.settings.runs import DemonstrationRunSettings
from mtcsirl.worlds.environments import OBSERVATION_MAPS, make_environment

SETTINGS = DemonstrationRunSettings(episodes=2, episode_steps=20)


@pytest.fixture(scope="module")
def policy() -> Policy:
    return FusedSac(1, SacSettings(hidden_sizes=(8,)), seeds=[0]).policy(0)


@pytest.fixture(scope="module")
def frame(policy) -> pd.DataFrame:
    return collect_demonstrations(policy, "reach", 1, SETTINGS, seed=3, cs_reward="velocity")


def _file(folder, frame, name="demonstrations.parquet"):
    write_parquet(folder / name, frame)
    return folder / name


def test_rows_are_whole_episodes_of_one_task_in_order(frame) -> None:
    assert tuple(frame.columns) == COLUMNS
    assert frame["episode"].tolist() == [0] * 20 + [1] * 20
    assert frame["step"].tolist() == [*range(20), *range(20)]
    assert set(frame["task"]) == {"reach"}
    assert set(frame["target"]) == {1}
    assert set(frame["cs_reward"]) == {"velocity"}
    for episode in (0, 20):
        after, following = frame["next_observation"][episode], frame["observation"][episode + 1]
        assert np.array_equal(after, following)
    assert np.array_equal(frame["observation"][0], frame["observation"][20])  # resets are identical
    assert not np.array_equal(frame["action"][0], frame["action"][20])  # the policy is stochastic
    assert frame["task_reward"].between(0, 10).all()


def test_same_seed_same_episodes(policy, frame) -> None:
    again = collect_demonstrations(policy, "reach", 1, SETTINGS, seed=3, cs_reward="velocity")
    pd.testing.assert_frame_equal(again, frame)


def test_loading_gives_what_the_agent_sees(tmp_path, frame) -> None:
    other = frame.assign(task="push-back")
    files = [_file(tmp_path, frame), _file(tmp_path, other, "other.parquet")]
    loaded = load_demonstrations(files, episodes=2, observation="mapped", cs_reward="velocity")
    assert loaded.members == (("reach", 1), ("push-back", 1))
    assert loaded.transitions.observation.shape == (2, 40, 39)
    assert loaded.transitions.task_reward.shape == (2, 40)
    raw = OBSERVATION_MAPS["mapped"].invert(loaded.transitions.observation[0])
    np.testing.assert_allclose(raw, np.stack(frame["observation"]), atol=1e-6)
    one = load_demonstrations(files, episodes=1, observation="raw", cs_reward="velocity").transitions
    assert torch.equal(one.next_observation[1], torch.from_numpy(np.stack(frame["next_observation"][:20])))
    assert velocity(one).max() < 1.5  # metres per second


def load(*files, episodes=2, cs_reward="velocity"):
    return load_demonstrations(files, episodes=episodes, observation="mapped", cs_reward=cs_reward)


def test_bad_files_are_one_clear_line(tmp_path, frame) -> None:
    good = _file(tmp_path, frame)
    with pytest.raises(UserError, match="has 2 episodes of 20 steps, 3 are asked for"):
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


def _with(frame: pd.DataFrame, column: str, row: int, value: object) -> pd.DataFrame:
    """The frame with one cell changed."""
    values = frame[column].to_list()
    values[row] = value
    return frame.assign(**{column: values})


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
@pytest.mark.parametrize("column", ["observation", "action", "next_observation", "task_reward"])
def test_numbers_that_are_none_are_refused(tmp_path, frame, column, value) -> None:
    """One NaN in r_task would make every weight of the reward NaN."""
    broken = value
    if column != "task_reward":
        broken = frame[column][7].copy()
        broken[2] = value
    file = _file(tmp_path, _with(frame, column, 7, broken))
    with pytest.raises(UserError, match=rf"demonstrations\.parquet: .*column {column} .*finite") as error:
        load(file)
    assert "\n" not in str(error.value)
    with pytest.raises(UserError, match=f"column {column}"):
        read_demonstrations(file)
    assert len(read_demonstrations(_file(tmp_path, frame))) == len(frame)


def test_actions_reach_one_and_no_further(tmp_path, frame) -> None:
    load(_file(tmp_path, _with(frame, "action", 3, np.array([1.0, -1.0, 0.0, 1.0], np.float32))))
    with pytest.raises(UserError, match=r"column action holds an action outside of \[-1, 1\]"):
        load(_file(tmp_path, _with(frame, "action", 3, np.array([1.0, -1.001, 0.0, 1.0], np.float32))))


def test_incomplete_episodes_are_refused(tmp_path, frame) -> None:
    with pytest.raises(UserError, match="has 1 episodes of 20 steps, 2 are asked for"):
        load(_file(tmp_path, frame.drop(index=7)))
    with pytest.raises(UserError, match="has 1 episodes of 20 steps"):
        load(_file(tmp_path, frame.iloc[:-1]))
    with pytest.raises(UserError, match="out of order"):
        load(_file(tmp_path, frame.iloc[::-1]))
    with pytest.raises(UserError, match="lacks steps"):
        load(_file(tmp_path, _with(frame, "step", 7, 8)))
    load(_file(tmp_path, frame.drop(index=39)), episodes=1)  # the first episode is whole


def test_demonstrations_of_another_cs_reward_are_refused(tmp_path, frame) -> None:
    file = _file(tmp_path, frame)
    load(file, cs_reward="velocity")
    with pytest.raises(UserError, match=r"demonstrations\.parquet: .* expert of velocity, not of action_norm"):
        load(file, cs_reward="action_norm")
    with pytest.raises(UserError, match="expert of no cs-reward, not of velocity"):
        load(_file(tmp_path, frame.assign(cs_reward="")))
    with pytest.raises(UserError, match="lacks the column cs_reward"):
        load(_file(tmp_path, frame.drop(columns="cs_reward")))


def test_a_policy_of_nan_demonstrates_nothing(policy, tmp_path, monkeypatch) -> None:
    monkeypatch.chdir(tmp_path)  # MuJoCo writes its log where it runs
    broken = replace(policy, biases=tuple(np.full_like(bias, np.nan) for bias in policy.biases))
    with pytest.raises(UserError, match=r"policy of drawer-close-t0: step 0: .* not finite"):
        collect_demonstrations(broken, "drawer-close", 0, SETTINGS, seed=3)


class Explosive:
    """Acts as ``policy`` does; in the second episode the simulation blows up at step 5."""

    def __init__(self, policy, monkeypatch):
        self.policy, self.observation, self.steps = policy, policy.observation, 0
        monkeypatch.setattr(demonstrations, "make_environment", self._make)

    def _make(self, *arguments, **options):
        self.environment = make_environment(*arguments, **options)
        return self.environment

    def act(self, observation, generator=None):
        self.steps += 1
        if self.steps == 26:
            self.environment.simulator.data.qvel[:] = 1e12
        return self.policy.act(observation, generator)


def test_an_episode_whose_simulation_diverged_stays_behind_the_whole_ones(policy, tmp_path, monkeypatch) -> None:
    monkeypatch.chdir(tmp_path)
    found = collect_demonstrations(Explosive(policy, monkeypatch), "reach", 1, SETTINGS, seed=3, cs_reward="velocity")
    assert found.groupby("episode").size().to_dict() == {0: 20, 1: 20, 2: 5}
    assert whole_episodes(found)["episode"].unique().tolist() == [0, 1]
    assert load(_file(tmp_path, found)).transitions.task_reward.shape == (1, 40)
    with pytest.raises(UserError, match="has 2 episodes of 20 steps, 3 are asked for"):
        load(_file(tmp_path, found), episodes=3)
    means = demonstrated(found.assign(success=True))
    assert means["diverged"] == 1.0
    assert means["success"] == pytest.approx(2 / 3)
    assert demonstrated(found[found["episode"] < 2].assign(success=True))["diverged"] == 0.0


def test_more_failures_than_episodes_are_an_error(policy, tmp_path, monkeypatch) -> None:
    monkeypatch.chdir(tmp_path)
    explosive = Explosive(policy, monkeypatch)
    explosive.act = lambda observation, generator=None: (
        explosive.environment.simulator.data.qvel.fill(1e12) or policy.act(observation, generator)
    )
    with pytest.raises(UserError, match="diverged in 3 of 3 episodes"):
        collect_demonstrations(explosive, "reach", 1, SETTINGS, seed=3)
