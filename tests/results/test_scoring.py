import numpy as np
import pandas as pd
import pytest
import torch

from mtcsirl.episodes.policy import Policy, save_policy
from mtcsirl.errors import UserError
from mtcsirl.files import storage
from mtcsirl.results import scoring
from mtcsirl.rewards.learned import LearnedReward, save_learned_reward
from mtcsirl.rewards.networks import RewardNetwork
from mtcsirl.settings import ScoreSettings
from mtcsirl.settings.runs import ScoreRunSettings

SETTINGS = ScoreRunSettings(score=ScoreSettings(transitions=120, bootstrap=20))
ARCHITECTURE = {
    "kind": "perceptron", "observation_size": 39, "action_size": 4, "hidden_sizes": [8],
    "output_scale": 10.0, "shaping": False, "discount": 0.99,
}  # fmt: skip


def policy(seed):
    random = np.random.default_rng(seed)
    weights = tuple(random.normal(0, 0.1, shape).astype(np.float32) for shape in ((16, 39), (8, 16)))
    return Policy(weights=weights, biases=(np.zeros(16, np.float32), np.zeros(8, np.float32)))


def samples(members, episodes, steps):
    random = np.random.default_rng(0)
    rows = [
        {
            "observation": random.normal(size=39), "action": random.uniform(-1, 1, 4),
            "next_observation": random.normal(size=39), "task_reward": random.uniform(0, 10),
            "task": task, "target": target, "episode": episode, "step": step,
        }
        for task, target in members for episode in range(episodes) for step in range(steps)
    ]  # fmt: skip
    return pd.DataFrame(rows)


@pytest.fixture(scope="module")
def folders(tmp_path_factory):
    root = tmp_path_factory.mktemp("runs")
    network = RewardNetwork(ARCHITECTURE, random=torch.Generator().manual_seed(7))
    learned = LearnedReward(network, "mt_csirl", "action_norm", "mapped", (("reach", 1), ("door-close", 1)))
    save_learned_reward(learned, root / "irl")
    storage.write_parquet(root / "irl" / "samples.parquet", samples(learned.members, 4, 30))
    for seed, name in enumerate(("expert", "sac")):
        save_policy(policy(seed), root / name)
    return root


def run(folders, output, **changes):
    settings = SETTINGS.model_copy(update=changes.pop("settings", {}))
    arguments = {"task": "drawer-close", "target": 0, "cs_reward": "action_norm", "seed": 3} | changes
    scoring.score(settings, folders / "irl", folders / "expert", folders / "sac", **arguments, output=output)
    return storage.read_csv(output / "scores.csv"), storage.read_parquet(output / "points.parquet")


@pytest.fixture(scope="module")
def results(folders):
    return run(folders, folders / "scores")


def value(scores, **key):
    for name, wanted in key.items():
        scores = scores[scores[name] == wanted]
    assert len(scores) == 1
    return scores.iloc[0]


def test_every_set_reward_and_statistic_has_a_row(results):
    scores, points = results
    assert len(scores) == 5 * 5 * 5
    within = dict.fromkeys(["expert", "generator", "sac", "uniform"], 120)
    assert points.groupby("transitions").size().to_dict() == within | {"across": 480}
    assert scores.groupby("transitions")["n"].max().to_dict() == within | {"across": 480}


def test_controls_say_what_they_must(results):
    scores, _ = results
    for transitions in ("expert", "sac", "uniform", "generator"):
        for statistic in ("pearson", "spearman", "pearson_residual", "spearman_residual"):
            key = {"transitions": transitions, "statistic": statistic}
            assert value(scores, reward="truth", **key)["value"] == pytest.approx(1.0)
            assert np.isnan(value(scores, reward="zero", **key)["value"])
        assert value(scores, reward="truth", transitions=transitions, statistic="epic")["value"] == pytest.approx(
            0.0, abs=1e-6
        )


def test_scores_agree_with_the_points(results):
    scores, points = results
    own = points[points["transitions"] == "uniform"]
    expected = np.corrcoef(own["learned"], own["truth"])[0, 1]
    found = value(scores, reward="learned", transitions="uniform", statistic="pearson")
    assert found["value"] == pytest.approx(expected, abs=1e-6)
    assert own["truth"].between(-3, 0).all()
    assert found["episodes"] == 1
    assert np.isnan(found["low"]), "one episode has no interval"
    several = value(scores, reward="learned", transitions="generator", statistic="pearson")
    assert several["low"] <= several["value"] <= several["high"]


def test_same_seed_same_bytes_and_another_seed_others(folders, results, tmp_path):
    again, _ = run(folders, tmp_path / "again")
    pd.testing.assert_frame_equal(again, results[0])
    other, _ = run(folders, tmp_path / "other", seed=4)
    assert not np.allclose(other["value"], again["value"], equal_nan=True)


def test_last_episodes_are_whole_and_from_every_member():
    frame = samples((("reach", 1), ("door-close", 2)), episodes=5, steps=10)
    chosen = scoring.last_episodes(frame, 40, "raw")
    assert len(chosen.episode) == 40
    assert np.bincount(chosen.episode).tolist() == [10, 10, 10, 10]
    assert len(scoring.last_episodes(frame, 5, "raw").episode) == 20, "at least one episode of each"
    last = torch.tensor(np.stack(frame["action"].to_list())[-1], dtype=torch.float32)
    assert torch.equal(chosen.transitions.action[-1], last)


def test_a_reward_of_another_kind_is_one_line(folders, tmp_path):
    with pytest.raises(UserError, match="learned from action_norm experts"):
        run(folders, tmp_path, cs_reward="velocity")
    raw = SETTINGS.environment.model_copy(update={"observation": "raw"})
    with pytest.raises(UserError, match="observation"):
        run(folders, tmp_path, settings={"environment": raw})
