"""Stored policies: they come back as they were, bad files are refused in one line, others can read an export."""

import json
from dataclasses import replace

import numpy as np
import pytest
from stable_baselines3 import SAC

from mtcsirl.agents.sac import FusedSac
from mtcsirl.cli import main
from mtcsirl.episodes.policy import finite_action, load_policy, save_policy
from mtcsirl.errors import UserError
from mtcsirl.exports.sb3 import export_sb3
from mtcsirl.worlds.environments import OBSERVATION_MAPS, make_environment


@pytest.fixture
def policy(small_sac):
    return FusedSac(1, small_sac, seeds=[4]).policy(0)


@pytest.fixture
def observations():
    return np.random.default_rng(0).standard_normal((20, 39)).astype(np.float32)


def test_round_trip(policy, observations, tmp_path):
    save_policy(policy, tmp_path)
    loaded = load_policy(tmp_path)
    assert np.array_equal(policy.act(observations), loaded.act(observations))
    drawn = [one.act(observations, np.random.default_rng(3)) for one in (policy, loaded)]
    assert np.array_equal(*drawn)
    assert not np.array_equal(drawn[0], policy.act(observations))
    assert loaded.observation == "mapped"


def test_named_policies_share_a_folder(policy, tmp_path):
    save_policy(policy, tmp_path, "reach-t1")
    assert (tmp_path / "reach-t1.safetensors").is_file()
    load_policy(tmp_path, "reach-t1")


@pytest.mark.parametrize("size", [0, 8, 500])
def test_truncated_weights_are_one_line(policy, tmp_path, size):
    save_policy(policy, tmp_path)
    file = tmp_path / "policy.safetensors"
    file.write_bytes(file.read_bytes()[:size])
    with pytest.raises(UserError, match=r"policy\.safetensors") as error:
        load_policy(tmp_path)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    ("key", "value", "file"),
    [
        ("format", "mtcsirl policy 99", "policy.json"),
        ("sizes", [39, 16, 16, 9], "policy.safetensors"),
        ("sizes", "many", "policy.json"),
        ("sizes", None, "policy.json"),
        ("observation", "upside-down", "policy.json"),
        ("min_log_std", "low", "policy.json"),
        ("max_log_std", float("nan"), "policy.json"),
    ],
)
def test_tampered_description_is_refused(policy, tmp_path, key, value, file):
    save_policy(policy, tmp_path)
    description = json.loads((tmp_path / "policy.json").read_text())
    (tmp_path / "policy.json").write_text(json.dumps(description | {key: value}))
    with pytest.raises(UserError, match=file):
        load_policy(tmp_path)


@pytest.mark.parametrize("value", [np.nan, np.inf])
@pytest.mark.parametrize("layer", ["weight_1", "bias_0"])
def test_weights_that_are_not_finite_are_one_line(policy, tmp_path, layer, value):
    tensors = policy.tensors()
    save_policy(policy, tmp_path / "good")
    load_policy(tmp_path / "good")
    tensors[layer].view(-1)[3] = value
    save_policy(policy.with_tensors(tensors), tmp_path)
    with pytest.raises(UserError, match=rf"policy\.safetensors: {layer} hold numbers that are not finite") as error:
        load_policy(tmp_path)
    assert "\n" not in str(error.value)


@pytest.mark.filterwarnings("ignore:overflow", "ignore:invalid value")
def test_a_policy_whose_weights_overflow_is_named(policy, observations):
    weights = [np.full_like(weight, 3e38) for weight in policy.weights]
    weights[-1][:, ::2] *= -1  # inf - inf
    huge = replace(policy, weights=tuple(weights))
    with pytest.raises(UserError, match=r"reach-t0: step 3: the action .* is not finite"):
        finite_action(huge, np.abs(observations[0]), np.random.default_rng(0), "reach-t0: step 3")
    assert np.isfinite(finite_action(policy, observations[0], None, "")).all()


def test_missing_policy_is_one_line(tmp_path):
    with pytest.raises(UserError, match="no such file"):
        load_policy(tmp_path)


def test_exported_zip_acts_on_meta_worlds_own_observations(policy, tmp_path):
    """Stable-baselines3's model on raw observations of a real rollout, ours on the mapped ones."""
    save_policy(policy, tmp_path)
    assert main(["export-policy", "--policy", str(tmp_path), "--output", str(tmp_path / "model.zip")]) == 0
    model = SAC.load(tmp_path / "model.zip", device="cpu")
    environment = make_environment("reach", 0, observation="raw")
    observation, _ = environment.reset()
    for _ in range(20):
        action, _ = model.predict(observation, deterministic=True)
        mapped = OBSERVATION_MAPS["mapped"].apply(observation.astype(np.float64))
        np.testing.assert_allclose(action, policy.act(mapped.astype(np.float32)), atol=1e-4)
        observation, *_ = environment.step(action)


def test_exported_zip_of_a_policy_that_saw_raw_observations(policy, observations, tmp_path):
    raw = replace(policy, observation="raw")
    save_policy(raw, tmp_path)
    export_sb3(tmp_path, tmp_path / "model.zip")
    actions, _ = SAC.load(tmp_path / "model.zip", device="cpu").predict(observations, deterministic=True)
    np.testing.assert_allclose(actions, raw.act(observations), atol=1e-6)


def test_export_refuses_bounds_that_the_other_side_lacks(small_sac, tmp_path):
    narrow = small_sac.model_copy(update={"min_log_std": -5.0})
    save_policy(FusedSac(1, narrow, seeds=[0]).policy(0), tmp_path)
    with pytest.raises(UserError, match="log_std"):
        export_sb3(tmp_path, tmp_path / "model.zip")
