"""What the suite takes for granted about Meta-World and MuJoCo, and would not notice changing."""

import inspect
from collections.abc import Iterator

import metaworld
import mujoco
import numpy as np
import pytest
from gymnasium import spaces
from metaworld.env_dict import ALL_V3_ENVIRONMENTS
from metaworld.sawyer_xyz_env import SawyerXYZEnv

from mtcsirl.names import TARGETS_PER_TASK, TASKS
from mtcsirl.rewards import ground_truth
from mtcsirl.worlds.environments import EPISODE_STEPS, STEP_SECONDS
from mtcsirl.worlds.fast.environment import FastEnvironment
from mtcsirl.worlds.fast.identity import stock_environment

STILL = np.zeros(4, np.float32)


@pytest.fixture(scope="module")
def reach() -> SawyerXYZEnv:
    return stock_environment("reach", 0)


def rollout(environment: SawyerXYZEnv, actions: np.ndarray) -> Iterator[tuple]:
    environment.reset()
    return (environment.step(action) for action in actions)


def speeds(observations: np.ndarray) -> np.ndarray:
    return np.linalg.norm(observations[:, 0:3] - observations[:, 18:21], axis=1) / STEP_SECONDS


def test_tasks_are_meta_worlds() -> None:
    assert {f"{task}-v3" for task in TASKS} == set(ALL_V3_ENVIRONMENTS)
    assert metaworld._N_GOALS == TARGETS_PER_TASK


def test_a_step_takes_an_eightieth_of_a_second(reach: SawyerXYZEnv) -> None:
    assert reach.frame_skip == 5
    assert reach.model.opt.timestep == 0.0025
    assert reach.dt == pytest.approx(STEP_SECONDS) == ground_truth.STEP_SECONDS


def test_rewards_are_those_of_version_2() -> None:
    versions = {inspect.signature(task).parameters["reward_function_version"].default for task in _tasks()}
    assert versions == {"v2"}


def test_observation_layout(reach: SawyerXYZEnv) -> None:
    before, _ = reach.reset()
    assert np.array_equal(before[18:36], before[0:18])
    after, *_ = reach.step(np.array([1, -1, 0.5, 1], np.float32))
    assert after.dtype == np.float64
    assert np.array_equal(after[0:3], reach.data.body("hand").xpos)
    assert 0 <= after[3] <= 1
    assert np.array_equal(after[4:7], reach.data.body("obj").xpos)
    assert np.array_equal(after[18:36], before[0:18])
    assert np.array_equal(after[36:39], reach._target_pos)
    assert after[36:39].all()


def test_stock_observation_space_denies_the_goal_that_it_shows(reach: SawyerXYZEnv) -> None:
    assert isinstance(reach.observation_space, spaces.Box)
    assert not reach.observation_space.high[36:].any()


def test_resets_are_identical_once_the_target_is_fixed(reach: SawyerXYZEnv) -> None:
    first, _ = reach.reset()
    reach.step(np.ones(4, np.float32))
    assert np.array_equal(reach.reset(seed=7)[0], first)


def test_episode_is_never_terminated_and_truncated_at_500(reach: SawyerXYZEnv) -> None:
    outcomes = list(rollout(reach, np.tile(STILL, (EPISODE_STEPS, 1))))
    assert not any(terminated for _, _, terminated, _, _ in outcomes)
    assert [truncated for *_, truncated, _ in outcomes].index(True) == EPISODE_STEPS - 1
    with pytest.raises(ValueError, match="reset"):
        reach.step(STILL)


def test_full_action_on_one_axis_is_the_papers_target_velocity(reach: SawyerXYZEnv) -> None:
    observations = np.array([observation for observation, *_ in rollout(reach, np.tile([1, 0, 0, 0], (30, 1)))])
    assert speeds(observations)[15:] == pytest.approx(0.8, abs=0.02)
    assert np.argmax(speeds(observations) > 0.85 * 0.8) in range(6, 10)  # steps from rest to 85 % of it


def test_random_actions_are_far_below_it(reach: SawyerXYZEnv) -> None:
    actions = np.random.default_rng(0).uniform(-1, 1, (EPISODE_STEPS, 4))
    observations = np.array([observation for observation, *_ in rollout(reach, actions)])
    assert speeds(observations).mean() == pytest.approx(0.28, abs=0.04)


def test_task_reward_lies_between_0_and_10() -> None:
    actions = np.random.default_rng(0).uniform(-1, 1, (100, 4)).astype(np.float32)
    for task in ("coffee-button", "door-close"):
        rewards = [reward for _, reward, *_ in rollout(stock_environment(task, 0), actions)]
        assert 0 <= min(rewards) <= max(rewards) <= 10


def test_reach_pays_10_within_5_centimetres(reach: SawyerXYZEnv) -> None:
    reach.reset()
    for _ in range(100):
        to_goal = reach._target_pos - reach.tcp_center
        _, reward, *_, info = reach.step(np.append(10 * to_goal, 1).clip(-1, 1).astype(np.float32))
        distance = np.linalg.norm(reach._target_pos - reach.tcp_center)
        assert (reward == 10) == (distance <= 0.05) == bool(info["success"])
    assert reward == 10


def test_mujoco_starts_over_with_only_a_counter_to_tell(
    reach: SawyerXYZEnv, tmp_path: object, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(str(tmp_path))  # MuJoCo writes its log where it runs
    reach.reset()
    reach.data.qvel[0] = np.nan
    observation, *_ = reach.step(STILL)
    assert np.isfinite(observation).all()
    assert reach.data.warning[mujoco.mjtWarning.mjWARN_BADQVEL].number == 1
    assert reach.data.time < 0.0125 + 1e-9
    reach.reset()
    assert reach.data.warning[mujoco.mjtWarning.mjWARN_BADQVEL].number == 0


def test_simulation_places_sites_itself(reach: SawyerXYZEnv) -> None:
    # Stock moves the target's site before mj_forward; the fast environment leaves it out.
    reach.reset()
    reach.data.site("goal").xpos = (9.0, 9.0, 9.0)
    mujoco.mj_forward(reach.model, reach.data)
    assert reach.data.site("goal").xpos == pytest.approx(reach._target_pos)


def test_corner2_hangs_upside_down(reach: SawyerXYZEnv) -> None:
    up = reach.data.camera("corner2").xmat.reshape(3, 3)[:, 1]
    assert up[2] < -0.5


@pytest.mark.parametrize("task", TASKS)
def test_no_task_redefines_what_the_fast_environment_does(task: str) -> None:
    replaced = {name for name in vars(FastEnvironment) if not name.startswith("__")} & vars(SawyerXYZEnv).keys()
    assert {"step", "reset", "set_xyz_action", "touching_object", "_get_obs"} <= replaced
    assert not replaced & vars(ALL_V3_ENVIRONMENTS[f"{task}-v3"]).keys()


def _tasks() -> list[type[SawyerXYZEnv]]:
    return list(ALL_V3_ENVIRONMENTS.values())
