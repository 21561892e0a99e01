from shutil import copytree

import numpy as np
import pandas as pd
import pytest
import torch

from mtcsirl.cli import main
from mtcsirl.episodes.evaluation import Evaluated
from mtcsirl.episodes.policy import Policy, save_policy
from mtcsirl.errors import UserError
from mtcsirl.files import storage
from mtcsirl.results import scoring
from mtcsirl.results.correlation import partial_correlation
from mtcsirl.rewards.learned import LearnedReward, save_learned_reward
from mtcsirl.rewards.networks import RewardNetwork
from mtcsirl.settings import ScoreSettings
from mtcsirl.settings.runs import ScoreRunSettings

SEEDS = (4, 9)
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
    for name, cs_reward in (("expert", "action_norm"), ("sac", "")):
        for seed in SEEDS:
            folder = root / name / str(seed)
            save_policy(policy(seed + 10 * len(name)), folder)
            key = dict(zip(Evaluated._fields, ("drawer-close", 0, cs_reward, seed), strict=True))
            row = key | {"policy": "stochastic", "kept": "kept", "episode": 0, "metric": "success", "value": 1.0}
            storage.write_csv(folder / "evaluation.csv", pd.DataFrame([row]))
    return root


def run(folders, output, **changes):
    settings = SETTINGS.model_copy(update=changes.pop("settings", {}))
    given = {name: [folders / name / str(seed) for seed in SEEDS] for name in ("expert", "sac")}
    policies = given | changes.pop("policies", {})
    arguments = {"task": "drawer-close", "target": 0, "cs_reward": "action_norm", "seed": 3} | changes
    scoring.score(settings, folders / "irl", policies["expert"], policies["sac"], **arguments, output=output)
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
    assert tuple(scores.columns) == scoring.SCORE_COLUMNS
    assert len(scores) == 5 * 5 * 6
    sizes = {"expert": 240, "generator": 120, "sac": 240, "uniform": 120, "across": 480}
    assert points.groupby("transitions").size().to_dict() == sizes
    assert scores.groupby("transitions")["n"].max().to_dict() == sizes


def test_scores_say_whose_they_are(results):
    scores, _ = results
    said = scores[list(scoring.KEY)].drop_duplicates().to_numpy().tolist()
    assert said == [["multi_task", "mt_csirl", "action_norm", "all", "drawer-close", 0, 3]]


def test_points_are_small_and_say_who_acted(results):
    _, points = results
    assert list(points.columns) == ["transitions", "agent", "episode", *scoring.POINT_VALUES]
    assert {points[name].dtype for name in scoring.POINT_VALUES} == {np.dtype("float32")}
    agents = points.groupby("transitions")["agent"].unique().map(sorted).to_dict()
    assert agents.pop("across") == [0, 1, 2, 3, 4], "one episode of an expert and one of SAC are a part"
    assert agents == {"expert": [4, 9], "sac": [4, 9], "uniform": [0], "generator": [0, 1]}
    for _, own in points.groupby("transitions"):
        assert own.groupby("episode")["agent"].nunique().max() == 1, "an episode is one agent's"
    whole = points[points["transitions"].isin(["expert", "sac"])].groupby(["transitions", "agent", "episode"]).size()
    assert whole.tolist() == [120] * 4, "as many whole episodes of every seed"


def test_across_holds_equal_parts_of_all_sets(results):
    """Of two experts and two baselines one episode each is a part as large as that of the generators."""
    _, points = results
    across = points[points["transitions"] == "across"]
    for name, part in (("expert", 120), ("sac", 120), ("uniform", 120), ("generator", 120)):
        own = points[points["transitions"] == name]
        assert across["learned"].isin(own["learned"]).sum() == part


def test_equal_parts_are_taken_from_all_agents_in_turn():
    frame = samples((("reach", 1), ("door-close", 2)), episodes=4, steps=10)
    one, other = scoring.last_episodes(frame, 80, "raw"), scoring.last_episodes(frame, 40, "raw")
    both = scoring.together([one, other])
    assert np.bincount(both.agent).tolist() == [20, 20, 20, 20]
    assert np.bincount(both.episode).tolist() == [10] * 8


def test_controls_say_what_they_must(results):
    scores, _ = results
    for transitions in ("expert", "sac", "uniform", "generator"):
        for statistic in ("pearson", "spearman", "partial", "pearson_residual", "spearman_residual"):
            key = {"transitions": transitions, "statistic": statistic}
            assert value(scores, reward="truth", **key)["value"] == pytest.approx(1.0)
            assert np.isnan(value(scores, reward="zero", **key)["value"])
        assert np.isnan(value(scores, reward="minus_task", transitions=transitions, statistic="partial")["value"])
        assert np.isfinite(value(scores, reward="random", transitions=transitions, statistic="partial")["value"])
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
    partial = value(scores, reward="learned", transitions="across", statistic="partial")
    own = points[points["transitions"] == "across"]
    expected = partial_correlation(*(own[name].to_numpy(float) for name in ("learned", "truth", "task_reward")))
    assert partial["value"] == pytest.approx(expected, abs=1e-5)
    assert partial["low"] < partial["value"] < partial["high"]
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


def test_policies_of_other_agents_are_one_line(folders, tmp_path):
    with pytest.raises(UserError, match="holds an agent without a cs-reward on drawer-close-t0, not an expert of"):
        run(folders, tmp_path, policies={"expert": [folders / "sac/4"]})
    with pytest.raises(UserError, match="holds an expert of action_norm on drawer-close-t0, not an agent without"):
        run(folders, tmp_path, policies={"sac": [folders / "expert/4"]})
    with pytest.raises(UserError, match="on reach-t0"):
        run(folders, tmp_path, task="reach")
    with pytest.raises(UserError, match="a second policy of seed 4"):
        run(folders, tmp_path, policies={"sac": [folders / "sac/4", folders / "sac/4"]})


def test_policies_that_do_not_say_their_seed_are_numbered(folders, tmp_path):
    for seed in SEEDS:
        save_policy(policy(seed), tmp_path / str(seed))
    _, points = run(folders, tmp_path, policies={"sac": [tmp_path / str(seed) for seed in SEEDS]})
    assert sorted(points.loc[points["transitions"] == "sac", "agent"].unique()) == [0, 1]


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (lambda frame: frame.drop(columns="task_reward"), "lacks task_reward"),
        (lambda frame: frame.assign(task_reward=np.nan), "column task_reward"),
        (lambda frame: frame.assign(action=[np.full(4, np.inf)] * len(frame)), "column action"),
        (lambda frame: frame.assign(cs_reward="velocity"), "of an IRL run of velocity, not of action_norm"),
        (lambda frame: frame.iloc[:0], "lacks rows"),
    ],
)
def test_samples_that_cannot_be_scored_are_one_line(folders, tmp_path, change, says):
    copytree(folders / "irl", tmp_path / "irl")
    for name in ("expert", "sac"):
        (tmp_path / name).symlink_to(folders / name)
    frame = storage.read_parquet(folders / "irl" / "samples.parquet")
    storage.write_parquet(tmp_path / "irl" / "samples.parquet", frame.assign(cs_reward="action_norm"))
    run(tmp_path, tmp_path / "good")
    storage.write_parquet(tmp_path / "irl" / "samples.parquet", change(frame))
    with pytest.raises(UserError, match=rf"samples\.parquet: .*{says}") as error:
        run(tmp_path, tmp_path / "bad")
    assert "\n" not in str(error.value)


def test_verb_takes_several_experts_and_baselines(folders, tmp_path):
    settings = SETTINGS.model_dump_json()
    command = ["score-reward", "--reward", str(folders / "irl"), "--settings", settings, "--output", str(tmp_path)]
    command += ["--task", "drawer-close", "--target", "0", "--cs-reward", "action_norm", "--seed", "3"]
    for name, flag in (("expert", "--expert"), ("sac", "--baseline")):
        command += [flag, *(str(folders / name / str(seed)) for seed in SEEDS)]
    assert main(command) == 0
    inputs = storage.read_json(tmp_path / "provenance.json")["inputs"]
    assert set(inputs) == {"reward", "samples", "expert_0", "expert_1", "baseline_0", "baseline_1"}
