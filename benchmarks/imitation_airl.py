"""imitation's AIRL with stable-baselines3's SAC, for benchmarks/irl_steps.py and tests/irl/test_equal_to_imitation.py.

Runs in the environment that `sh benchmarks/peer_environment.sh imitation` makes and imports nothing of this suite:

    build/imitation/bin/python benchmarks/imitation_airl.py serve SETTINGS   one round per line of standard input
    build/imitation/bin/python benchmarks/imitation_airl.py record FILE      logits and losses of a fixed batch
"""

import json
import sys
import tempfile
from time import thread_time
from typing import Any

import gymnasium
import numpy as np
import torch
from imitation.algorithms.adversarial.airl import AIRL
from imitation.data.types import Transitions
from imitation.rewards.reward_nets import BasicRewardNet
from imitation.util import logger
from stable_baselines3 import SAC
from stable_baselines3.common.vec_env import DummyVecEnv

OBSERVATION, ACTION, EPISODE_STEPS = 39, 4, 500


class Noise(gymnasium.Env):
    """Observations that cost nothing: an environment of Meta-World's shape whose steps are random numbers."""

    observation_space = gymnasium.spaces.Box(-np.inf, np.inf, (OBSERVATION,), np.float32)
    action_space = gymnasium.spaces.Box(-1.0, 1.0, (ACTION,), np.float32)

    def reset(self, *, seed: int | None = None, options: dict | None = None) -> tuple[np.ndarray, dict]:
        """A first observation."""
        self._random, self._steps = np.random.default_rng(seed or 0), 0
        return self._random.standard_normal(OBSERVATION, dtype=np.float32), {}

    def step(self, action: np.ndarray) -> tuple[np.ndarray, float, bool, bool, dict]:
        """Another one; the episode is over after 500."""
        self._steps += 1
        observation = self._random.standard_normal(OBSERVATION, dtype=np.float32)
        return observation, 0.0, False, self._steps == EPISODE_STEPS, {}


def transitions(count: int, seed: int, observation: int = OBSERVATION, action: int = ACTION) -> Transitions:
    """Random transitions, actions inside their bounds."""
    random = np.random.default_rng(seed)
    states, following = random.standard_normal((2, count, observation)).astype(np.float32)
    actions = random.uniform(-0.95, 0.95, (count, action)).astype(np.float32)
    return Transitions(states, actions, np.array([{}] * count), following, np.zeros(count, dtype=bool))


def trainer(settings: dict[str, Any]) -> AIRL:
    """AIRL at the given settings; the names are those of `config/config.yaml`."""
    environment = DummyVecEnv([Noise])
    sac = SAC(
        "MlpPolicy",
        environment,
        learning_rate=settings["learning_rate"],
        buffer_size=settings["generator_memory"],
        learning_starts=settings["steps_per_iteration"],
        batch_size=settings["sac_minibatch"],
        train_freq=settings["steps_per_iteration"] // settings["generator_updates"],
        gradient_steps=1,
        ent_coef=settings["temperature"],
        policy_kwargs={"net_arch": settings["sac_hidden_sizes"]},
        seed=0,
        device="cpu",
    )
    network = BasicRewardNet(
        Noise.observation_space, Noise.action_space, use_next_state=True, hid_sizes=settings["hidden_sizes"]
    )
    return AIRL(
        demonstrations=transitions(settings["demonstrations"], 1),
        demo_batch_size=settings["minibatch"],
        venv=environment,
        gen_algo=sac,
        reward_net=network,
        n_disc_updates_per_round=settings["discriminator_updates"],
        disc_opt_kwargs={"lr": settings["discriminator_learning_rate"]},
        gen_train_timesteps=settings["steps_per_iteration"],
        gen_replay_buffer_capacity=settings["generator_replay"] * settings["steps_per_iteration"],
        log_dir=tempfile.mkdtemp(),
        custom_logger=logger.configure(tempfile.mkdtemp(), format_strs=[]),
    )


def serve(settings: dict[str, Any]) -> None:
    """Train one round for each line that comes in; answer with the CPU seconds of this thread."""
    airl = trainer(settings)
    for _ in sys.stdin:
        started = thread_time()
        airl.train(settings["steps_per_iteration"])
        print(thread_time() - started, flush=True)


def record(file: str) -> None:
    """Write a batch, the weights of f and of the policy, and imitation's log pi, logits and loss, as JSON."""
    settings = {
        "learning_rate": 3e-4, "generator_memory": 100, "steps_per_iteration": 10, "generator_updates": 5,
        "sac_minibatch": 8, "temperature": 1.0, "sac_hidden_sizes": [6, 5], "hidden_sizes": [7, 4], "minibatch": 12,
        "discriminator_updates": 1, "discriminator_learning_rate": 1e-3, "demonstrations": 12, "generator_replay": 1,
    }  # fmt: skip
    torch.manual_seed(0)
    airl = trainer(settings)
    sides = {"expert": transitions(12, 2), "generator": transitions(12, 3)}
    samples = [
        {"obs": side.obs, "acts": side.acts, "next_obs": side.next_obs, "dones": side.dones} for side in sides.values()
    ]
    (batch,) = airl._make_disc_train_batches(expert_samples=dict(samples[0]), gen_samples=dict(samples[1]))
    inputs = [batch[name] for name in ("state", "action", "next_state", "done", "log_policy_act_prob")]
    weights = {name: tensor.tolist() for name, tensor in airl.reward_train.state_dict().items()}
    policy = {name: tensor.tolist() for name, tensor in airl.policy.actor.state_dict().items()}
    logits = airl.logits_expert_is_high(*inputs)
    statistics = airl.train_disc(expert_samples=samples[0], gen_samples=samples[1])
    after = {name: tensor.tolist() for name, tensor in airl.reward_train.state_dict().items()}
    said = {
        "peer": "imitation 1.0.1, AIRL on stable-baselines3 2.2.1's SAC",
        "hidden_sizes": settings["hidden_sizes"],
        "sac_hidden_sizes": settings["sac_hidden_sizes"],
        "learning_rate": settings["discriminator_learning_rate"],
        "reward_weights": weights,
        "reward_weights_after_one_update": after,
        "policy_weights": policy,
        "observation": np.stack([side.obs for side in sides.values()]).tolist(),
        "action": np.stack([side.acts for side in sides.values()]).tolist(),
        "next_observation": np.stack([side.next_obs for side in sides.values()]).tolist(),
        "log_pi": inputs[-1].view(2, -1).tolist(),
        "logit": logits.detach().view(2, -1).tolist(),
        "loss": statistics["disc_loss"],
        "accuracy": statistics["disc_acc"],
    }
    short = json.loads(json.dumps(said), parse_float=lambda text: float(f"{float(text):.9g}"))  # float32 needs no more
    with open(file, "w", encoding="utf-8") as handle:
        handle.write(json.dumps(short) + "\n")


if __name__ == "__main__":
    torch.set_num_threads(1)
    serve(json.loads(sys.argv[2])) if sys.argv[1] == "serve" else record(sys.argv[2])
