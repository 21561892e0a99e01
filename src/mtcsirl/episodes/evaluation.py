"""Episodes of a finished policy as tidy rows, and the gates that an agent must pass."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import gymnasium
import numpy as np
import torch

from mtcsirl.episodes.policy import Policy
from mtcsirl.rewards.ground_truth import COMMON_SENSE_REWARDS
from mtcsirl.settings import GateSettings
from mtcsirl.settings.runs import AgentRunSettings, IrlRunSettings
from mtcsirl.transitions import Transitions
from mtcsirl.worlds.environments import OBSERVATION_MAPS, make_environment

Row = dict[str, Any]
COLUMNS = ("task", "target", "cs_reward", "seed", "policy", "episode", "metric", "value")
METRICS = ("success", *COMMON_SENSE_REWARDS, "task_reward")

_STREAM = 2
"""Separates the random numbers of evaluation from those of training with the same seed."""


def evaluate(
    policy: Policy,
    task: str,
    target: int,
    cs_reward: str,
    seed: int,
    settings: AgentRunSettings | IrlRunSettings,
    *,
    reuse: gymnasium.Env | None = None,
) -> list[Row]:
    """Run stochastic and deterministic episodes and measure each; one row per episode and metric.

    Success is 1 if the task was solved at any step. velocity is in m/s: the mean over the episode of the hand's
    displacement over 0.0125 s, in float64; action_norm the mean ||a||_1; task_reward the mean r_task, 0 to 10.
    `reuse` is an environment of this task and target, where one is open already.
    """
    env = reuse or make_environment(
        task,
        target,
        observation=policy.observation,
        target_seed=settings.environment.target_seed,
    )
    generator = np.random.default_rng([seed, _STREAM])
    rows: list[Row] = []
    for kind, noise in (("stochastic", generator), ("deterministic", None)):
        for episode in range(settings.evaluation.episodes):
            # Neither environment nor mode draws random numbers: one deterministic episode is all of them.
            if noise is not None or episode == 0:
                measured = run_episode(policy, env, settings.evaluation.episode_steps, noise)
            key = {"task": task, "target": target, "cs_reward": cs_reward, "seed": seed, "policy": kind}
            rows += [key | {"episode": episode, "metric": m, "value": v} for m, v in measured.items()]
    if reuse is None:
        env.close()
    return rows


def run_episode(
    policy: Policy, env: gymnasium.Env, steps: int, generator: np.random.Generator | None
) -> dict[str, float]:
    """The metrics of one episode of at most `steps` steps; without a generator the policy acts by its mode."""
    observation, _ = env.reset()
    actions, following, task_rewards, solved = [], [], [], False
    for _ in range(steps):
        action = policy.act(observation, generator)
        observation, task_reward, _, truncated, info = env.step(action)
        actions.append(action)
        following.append(observation)
        task_rewards.append(task_reward)
        solved = solved or info["success"]
        if truncated:
            break
    return measure_episode(np.array(actions), np.array(following), np.array(task_rewards), solved, policy.observation)


def measure_episode(
    action: np.ndarray, next_observation: np.ndarray, task_reward: np.ndarray, solved: bool, observation: str
) -> dict[str, float]:
    """success, every measure of the cs-reward registry and task_reward, as means over the steps [n, ...]."""
    raw = torch.from_numpy(OBSERVATION_MAPS[observation].invert(next_observation.astype(np.float64)))
    transitions = Transitions(
        raw, torch.from_numpy(action.astype(np.float64)), raw, torch.from_numpy(task_reward.astype(np.float64))
    )
    means = {name: float(reward.measure(transitions).mean()) for name, reward in COMMON_SENSE_REWARDS.items()}
    return {"success": float(solved), **means, "task_reward": float(task_reward.mean())}


def stochastic_means(rows: Sequence[Row]) -> dict[str, float]:
    """The mean of each metric over the stochastic episodes of `evaluate`'s rows."""
    chosen = [row for row in rows if row["policy"] == "stochastic"]
    return {metric: float(np.mean([row["value"] for row in chosen if row["metric"] == metric])) for metric in METRICS}


def gate_verdict(gate: str, means: dict[str, float], cs_reward: str, limits: GateSettings) -> dict[str, Any]:
    """The content of `gate.json`: whether an agent learned what it should have.

    gate: "expert" and "generator" ask for success and for the cs-reward's metric near its target, "sac" for
    success alone. An agent below its gate is marked by this, never dropped.
    """
    if gate not in ("expert", "generator", "sac"):
        raise ValueError(f"unknown gate {gate!r}")
    asked: dict[str, float] = {"success": limits.success}
    passed = means["success"] >= limits.success
    metric = None
    if gate != "sac":
        metric = means[cs_reward]
        asked["relative_distance"] = metric_limit(gate, cs_reward, limits)
        passed = passed and relative_distance(metric, cs_reward) <= asked["relative_distance"]
    return {"gate": gate, "passed": bool(passed), "success": means["success"], "metric": metric, "limits": asked}


def relative_distance(metric: float, cs_reward: str) -> float:
    """|metric - target| / target of a cs-reward."""
    target = COMMON_SENSE_REWARDS[cs_reward].target
    return abs(metric - target) / target


def metric_limit(gate: str, cs_reward: str, limits: GateSettings) -> float:
    """The largest relative distance to the target that passes; cs-rewards without a limit of their own take 0.15."""
    if gate == "generator":
        return limits.generator
    return getattr(limits, f"expert_{cs_reward}", limits.expert_velocity)
