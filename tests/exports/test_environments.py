"""The fast Meta-World under gymnasium's name, with rewards added; Meta-World's own set_task is followed."""

import gymnasium
import numpy as np
import pytest
import torch
from gymnasium.utils.env_checker import check_env
from metaworld import MT1
from metaworld.sawyer_xyz_env import SawyerXYZEnv
from stable_baselines3.common.env_checker import check_env as check_for_sb3

from mtcsirl.errors import UserError
from mtcsirl.exports.environments import AddedReward, make, register, with_learned_reward
from mtcsirl.names import TASKS
from mtcsirl.rewards.ground_truth import COMMON_SENSE_REWARDS
from mtcsirl.rewards.learned import save_learned_reward
from mtcsirl.settings import Settings
from mtcsirl.worlds.environments import make_environment
from mtcsirl.worlds.fast.factory import fast_class
from mtcsirl.worlds.fast.identity import stock_environment
from tests.rewards.test_learned import learned

ACTION = np.array([1.0, -0.5, 0.25, 1.0], dtype=np.float32)


def test_every_task_has_a_name_and_registering_again_changes_nothing() -> None:
    before = {name: spec for name, spec in gymnasium.registry.items() if name.startswith("mtcsirl/")}
    assert sorted(before) == sorted(f"mtcsirl/{task}-v0" for task in TASKS)
    register()
    assert all(gymnasium.registry[name] is spec for name, spec in before.items())


@pytest.mark.filterwarnings("ignore:.*minimum value is -infinity.*", "ignore:.*maximum value is infinity.*")
@pytest.mark.parametrize("cs_reward", [None, "velocity"])
def test_the_checkers_of_gymnasium_and_sb3_find_nothing(cs_reward: str | None) -> None:
    env = gymnasium.make("mtcsirl/reach-wall-v0", target=3, cs_reward=cs_reward, observation="mapped")
    check_env(env.unwrapped, skip_render_check=True)
    check_for_sb3(env)
    env.close()


def test_it_is_the_environment_of_the_suite_with_the_target_asked_for() -> None:
    ours = gymnasium.make("mtcsirl.exports.environments:mtcsirl/push-back-v0", target=5, observation="raw")
    expected = make_environment("push-back", 5, observation="raw")
    assert np.array_equal(ours.reset(seed=1)[0], expected.reset()[0])
    assert not np.array_equal(ours.reset()[0], make_environment("push-back", 4, observation="raw").reset()[0])
    assert ours.step(ACTION)[1] == expected.step(ACTION)[1]


@pytest.mark.parametrize("cs_reward", ["velocity", "action_norm"])
def test_the_ground_truth_is_added_with_the_weight_of_an_expert(cs_reward: str) -> None:
    env, plain = make("reach", cs_reward=cs_reward), make("reach")
    env.reset(), plain.reset()
    for _ in range(3):
        _, reward, _, _, info = env.step(ACTION)
        after, paid, *_ = plain.step(ACTION)
    raw = plain.observation_map.invert(after.astype(np.float64))
    measured = np.linalg.norm(raw[:3] - raw[18:21]) / 0.0125 if cs_reward == "velocity" else np.abs(ACTION).sum()
    truth = -abs(measured - COMMON_SENSE_REWARDS[cs_reward].target)
    assert info["task_reward"] == paid
    assert info["f"] == pytest.approx(truth, abs=1e-4)
    assert reward == pytest.approx(paid + Settings().expert.cs_weight[cs_reward] * truth, abs=1e-3)


def test_a_learned_reward_is_added_or_stands_alone(tmp_path) -> None:
    reward = learned()
    save_learned_reward(reward, tmp_path)
    beside = with_learned_reward(make("reach"), tmp_path, weight=2.0)
    alone = with_learned_reward(make("reach"), tmp_path, alone=True)
    beside.reset(), alone.reset()
    _, both, _, _, info = beside.step(ACTION)
    _, only, *_ = alone.step(ACTION)
    assert both == pytest.approx(info["task_reward"] + 2 * only)
    assert only == info["f"] != 0


def test_what_cannot_be_is_refused_in_one_line(tmp_path) -> None:
    save_learned_reward(learned(), tmp_path)
    with pytest.raises(UserError, match="learned on 'mapped' observations"):
        with_learned_reward(make("reach", observation="raw"), tmp_path)
    with pytest.raises(UserError, match="not of CartPoleEnv"):
        with_learned_reward(gymnasium.make("CartPole-v1"), tmp_path)
    with pytest.raises(UserError, match="cs_reward: unknown 'speed'; choose velocity"):
        make("reach", cs_reward="speed")
    with pytest.raises(UserError, match="render_mode: 'human'"):
        make("reach", render_mode="human")
    with pytest.raises(UserError, match="reset"):
        AddedReward(make("reach"), lambda transitions: torch.zeros(1)).step(ACTION)


def test_a_fast_class_follows_every_set_task_of_meta_world() -> None:
    tasks = MT1("reach-wall-v3", seed=0).train_tasks
    fast, stock = fast_class("reach-wall")(), stock_environment("reach-wall", 0)
    for target in (7, 2, 7):
        observations = []
        for env in (fast, stock):
            env.set_task(tasks[target])
            observations.append(env.reset()[0])
            observations.append(env.step(ACTION)[0])
        assert observations[0].tobytes() == observations[2].tobytes(), f"reset to target {target}"
        assert observations[1].tobytes() == observations[3].tobytes(), f"step towards target {target}"


def test_meta_worlds_set_task_alone_would_be_ignored() -> None:
    tasks = MT1("reach-wall-v3", seed=0).train_tasks
    fast = fast_class("reach-wall")()
    fast.set_task(tasks[7])
    first = fast.reset()[0]
    SawyerXYZEnv.set_task(fast, tasks[2])
    assert np.array_equal(first, fast.reset()[0])
