"""The environment: Meta-World bit for bit, target fixed, observation mapped, errors in one line."""

import warnings

import mujoco
import numpy as np
import pytest
import torch
from gymnasium.utils.env_checker import check_env
from metaworld import MT1
from metaworld.utils import reward_utils
from scipy.spatial.transform import Rotation

from mtcsirl.errors import UserError
from mtcsirl.names import DESIGN_TASKS
from mtcsirl.worlds.environments import EPISODE_STEPS, OBSERVATION_MAPS, TaskEnvironment, make_environment
from mtcsirl.worlds.fast.identity import first_difference, stock_environment, stock_task
from mtcsirl.worlds.fast.rotation import quaternion_of
from mtcsirl.worlds.fast.targets import target_vectors
from mtcsirl.worlds.fast.tolerance import tolerance

MAPPED = OBSERVATION_MAPS["mapped"]


@pytest.fixture(scope="module")
def environment() -> TaskEnvironment:
    return make_environment("reach", 0)


@pytest.mark.parametrize(("task", "seed"), [("push-back", 0), ("lever-pull", 3)])
def test_targets_are_those_of_mt1(task: str, seed: int) -> None:
    expected = MT1(f"{task}-v3", seed=seed).train_tasks
    assert [stock_task(task, target, seed) for target in range(50)] == expected


def test_drawing_targets_leaves_the_global_random_state_alone() -> None:
    before = np.random.get_state()[1].copy()  # noqa: NPY002
    target_vectors.__wrapped__("reach", 0)
    assert np.array_equal(before, np.random.get_state()[1])  # noqa: NPY002


@pytest.mark.parametrize("task", [*DESIGN_TASKS, "stick-pull", "dial-turn"])
def test_bit_identical_to_stock(task: str) -> None:
    # Random actions, the scripted policy, which touches the objects, and random actions again.
    with warnings.catch_warnings(action="ignore"):
        assert first_difference(task, 1, episodes=3, steps=40, scripted=(False, True)) is None


def test_comparison_with_stock_sees_another_target() -> None:
    stock, fast = stock_environment("drawer-close", 0), make_environment("drawer-close", 1).simulator
    assert not np.array_equal(stock.reset()[0], fast.reset()[0])


@pytest.mark.parametrize("task", ["reach", "push-back"])
def test_observation_is_the_mapped_stock_observation_in_float32(task: str) -> None:
    stock, mapped, raw = (
        stock_environment(task, 2),
        make_environment(task, 2),
        make_environment(task, 2, observation="raw"),
    )
    expected, _ = stock.reset()
    seen, _ = mapped.reset()
    raw.reset()
    action = np.array([0.3, -0.2, 0.5, 1.0], np.float32)
    for _ in range(5):
        assert np.array_equal(seen, MAPPED.apply(expected).astype(np.float32))
        expected, reward, *_ = stock.step(action)
        seen, our_reward, *_ = mapped.step(action)
        assert np.array_equal(raw.step(action)[0], expected.astype(np.float32))
        assert our_reward == reward
        assert seen.dtype == np.float32


def test_map_shows_velocity_where_the_previous_frame_was() -> None:
    raw = np.zeros(39)
    raw[0:3], raw[18:21] = (0.1, 0.71, 0.15), (0.1, 0.70, 0.16)
    mapped = MAPPED.apply(raw)
    assert mapped[0:3] == pytest.approx([1.0, 0.1, 0.0])
    assert mapped[18:21] == pytest.approx([0.0, 1.0, -1.0])


@pytest.mark.parametrize("name", OBSERVATION_MAPS)
@pytest.mark.parametrize("shape", [(39,), (4, 39), (2, 3, 39)])
def test_maps_are_invertible_in_numpy_and_torch_alike(name: str, shape: tuple[int, ...]) -> None:
    observation_map = OBSERVATION_MAPS[name]
    raw = np.random.default_rng(0).uniform(-1, 1, shape).astype(np.float32)
    mapped = observation_map.apply(raw)
    assert mapped.dtype == np.float32
    assert observation_map.invert(mapped) == pytest.approx(raw, abs=3e-7)
    assert np.array_equal(observation_map.apply(torch.from_numpy(raw)).numpy(), mapped)
    assert np.array_equal(observation_map.invert(torch.from_numpy(mapped)).numpy(), observation_map.invert(mapped))


def test_map_lets_gradients_through() -> None:
    raw = torch.zeros(39, requires_grad=True)
    MAPPED.apply(raw)[18].backward()
    assert raw.grad is not None
    assert raw.grad.nonzero().flatten().tolist() == [0, 18]
    assert raw.grad[[0, 18]].tolist() == [100.0, -100.0]


@pytest.mark.filterwarnings("ignore:.*observation space (min|max)imum value")
def test_gymnasium_accepts_the_environment(environment: TaskEnvironment) -> None:
    check_env(environment, skip_render_check=True)


def test_episode_ends_at_500_steps_only_though_the_task_succeeds() -> None:
    environment = make_environment("drawer-close", 0)
    environment.reset()
    goal = environment.simulator._target_pos
    outcomes = []
    for _ in range(EPISODE_STEPS):
        hand = environment.simulator.get_endeff_pos()
        lowered = abs(hand[2] - goal[2]) < 0.03
        to_drawer = goal + np.array((0, 0.1 if lowered else -0.2, 0)) - hand
        outcomes.append(environment.step(np.append(10 * to_drawer, 1).astype(np.float32).clip(-1, 1)))
    assert any(outcome[4]["success"] for outcome in outcomes[:-1])
    assert not any(outcome[2] for outcome in outcomes)
    assert [outcome[3] for outcome in outcomes] == [False] * (EPISODE_STEPS - 1) + [True]
    assert type(outcomes[0][4]["success"]) is bool
    with pytest.raises(ValueError, match="reset"):
        environment.step(np.zeros(4, np.float32))


def test_divergence_is_reported_until_the_next_reset(
    environment: TaskEnvironment, tmp_path: object, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(str(tmp_path))  # MuJoCo writes its log where it runs
    action = np.zeros(4, np.float32)
    first, _ = environment.reset()
    undisturbed = environment.step(action)
    assert undisturbed[4]["diverged"] is False
    environment.simulator.data.qvel[0] = np.nan
    assert environment.step(action)[4]["diverged"] is True
    assert environment.step(action)[4]["diverged"] is True
    again, _ = environment.reset()
    assert np.array_equal(again, first)
    repeated = environment.step(action)
    assert repeated[4]["diverged"] is False
    assert np.array_equal(repeated[0], undisturbed[0])


def test_environments_share_nothing() -> None:
    one, other = make_environment("reach", 0), make_environment("reach", 0)
    one.reset()
    expected = one.step(np.ones(4, np.float32))[0]
    one.reset()
    other.reset()
    other.step(-np.ones(4, np.float32))
    assert np.array_equal(one.step(np.ones(4, np.float32))[0], expected)


def test_picture_is_upright() -> None:
    try:
        environment = make_environment("reach", 0, render=True)
    except UserError as missing:
        pytest.skip(str(missing))
    environment.reset()
    picture = environment.render()
    environment.close()
    assert picture.shape == (480, 480, 3)
    assert picture[:60].std() < 5  # nothing but grey air above
    assert picture[-60:].std() > 30  # the table's legs on the floor


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("reach-v3", 0), "unknown task 'reach-v3'"),
        (("reach", 50), "0 to 49"),
        (("reach", -1), "0 to 49"),
    ],
)
def test_bad_task_or_target_is_one_line(arguments: tuple[str, int], message: str) -> None:
    with pytest.raises(UserError, match=message) as error:
        make_environment(*arguments)
    assert "\n" not in str(error.value)


def test_bad_map_is_one_line() -> None:
    with pytest.raises(UserError, match="unknown map 'blurred'; choose mapped or raw"):
        make_environment("reach", 0, observation="blurred")


def test_rendering_must_be_asked_for(environment: TaskEnvironment) -> None:
    with pytest.raises(UserError, match="render=True"):
        environment.render()


def test_quaternion_equals_scipys_bits() -> None:
    random, matrix = np.random.default_rng(0), np.empty(9)
    for i in range(2000):
        # Near the axes and near no rotation, where Shepperd's method changes its divisor, and anywhere.
        quaternion = np.round(random.normal(size=4)) + random.normal(size=4) * 10.0 ** -(i % 18)
        mujoco.mju_quat2Mat(matrix, quaternion / np.linalg.norm(quaternion))
        expected = Rotation.from_matrix(matrix.reshape(3, 3)).as_quat()
        assert quaternion_of(matrix.reshape(3, 3)).tobytes() == expected.tobytes()


@pytest.mark.parametrize("sigmoid", ["long_tail", "gaussian", "hyperbolic"])
@pytest.mark.parametrize("number", [float, np.float64, np.float32])
def test_tolerance_equals_meta_worlds_bits(sigmoid: str, number: type) -> None:
    random = np.random.default_rng(0)
    for _ in range(300):
        arguments = number(random.normal(0, 0.1)), (0, float(random.choice([0.005, 0.05]))), random.exponential(0.2)
        expected = reward_utils.tolerance(*arguments, sigmoid)
        ours = tolerance(*arguments, sigmoid)
        assert (ours, type(ours)) == (expected, type(expected))
    assert tolerance(0.1, (0, 0.05)) == reward_utils.tolerance(0.1, (0, 0.05))
