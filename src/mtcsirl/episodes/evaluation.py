"""Episodes of a finished policy as tidy rows: what every agent is measured by."""

from __future__ import annotations

from pathlib import Path
from typing import Any, NamedTuple

import gymnasium
import numpy as np
import torch

from mtcsirl.episodes.policy import Policy, finite_action
from mtcsirl.errors import UserError
from mtcsirl.files import storage
from mtcsirl.names import DIVERGED, KEPT, distance_metric
from mtcsirl.rewards.ground_truth import COMMON_SENSE_REWARDS
from mtcsirl.settings.runs import AgentRunSettings, IrlRunSettings
from mtcsirl.transitions import Transitions
from mtcsirl.worlds.environments import OBSERVATION_MAPS, make_environment

Row = dict[str, Any]
COLUMNS = ("task", "target", "cs_reward", "seed", "policy", KEPT, "episode", "metric", "value")

_STREAM = 2
"""Separates the random numbers of evaluation from those of training with the same seed."""


def metrics() -> tuple[str, ...]:
    """What an evaluation measures of an episode, in the order of its rows."""
    distances = (distance_metric(name) for name in COMMON_SENSE_REWARDS)
    return ("success", *COMMON_SENSE_REWARDS, *distances, "task_reward", DIVERGED)


def evaluate(
    policy: Policy,
    task: str,
    target: int,
    cs_reward: str,
    seed: int,
    settings: AgentRunSettings | IrlRunSettings,
    kept: str = KEPT,
    *,
    reuse: gymnasium.Env | None = None,
) -> list[Row]:
    """Run stochastic and deterministic episodes and measure each; one row per episode and metric.

    Success is 1 if the task was solved at any step. velocity is in m/s: the mean over the episode of the hand's
    displacement over 0.0125 s, in float64; action_norm the mean ||a||_1; NAME_distance the mean |m - target| over the
    episode's steps of each cs-reward's measure m; task_reward the mean r_task, 0 to 10; diverged 1 if the simulation
    diverged, see ``run_episode``. ``kept`` says which policy of its training this is, "kept" or "last": both act with
    the same random numbers. ``reuse`` is an environment of this task and target, where one is open already.

    Raises:
        UserError: the policy's action is not finite.
    """
    env = reuse or make_environment(
        task,
        target,
        observation=policy.observation,
        target_seed=settings.environment.target_seed,
    )
    who = f"policy of {task}-t{target}, seed {seed}"
    generator = np.random.default_rng([seed, _STREAM])
    rows: list[Row] = []
    for kind, noise in (("stochastic", generator), ("deterministic", None)):
        for episode in range(settings.evaluation.episodes):
            # Neither environment nor mode draws random numbers: one deterministic episode is all of them.
            if noise is not None or episode == 0:
                measured = run_episode(policy, env, settings.evaluation.episode_steps, noise, who)
            key = {"task": task, "target": target, "cs_reward": cs_reward, "seed": seed, "policy": kind, KEPT: kept}
            rows += [key | {"episode": episode, "metric": m, "value": v} for m, v in measured.items()]
    if reuse is None:
        env.close()
    return rows


def run_episode(
    policy: Policy, env: gymnasium.Env, steps: int, generator: np.random.Generator | None, who: str = "policy"
) -> dict[str, float]:
    """The metrics of one episode of at most ``steps`` steps; without a generator the policy acts by its mode.

    A simulation that diverges, or gives an observation or reward that is no number, ends the episode as failed: success
    0, diverged 1, the other metrics over the steps before. (MuJoCo starts over from its default state, so that what
    follows means nothing.) ``who`` names the policy in errors.

    Raises:
        UserError: an action is not finite, or already the first step diverged.
    """
    observation, _ = env.reset()
    actions, following, task_rewards, solved, diverged = [], [], [], False, False
    for step in range(steps):
        action = finite_action(policy, observation, generator, f"{who}: step {step}")
        observation, task_reward, _, truncated, info = env.step(action)
        diverged = broken(observation, float(task_reward), info)
        if diverged:
            break
        actions.append(action)
        following.append(observation)
        task_rewards.append(task_reward)
        solved = solved or info["success"]
        if truncated:
            break
    if not actions:
        raise UserError(f"{who}: the simulation diverged at the first step; check the installation of Meta-World")
    columns = np.array(actions), np.array(following), np.array(task_rewards)
    measured = measure_episode(*columns, solved and not diverged, policy.observation)
    return measured | {DIVERGED: float(diverged)}


def broken(observation: np.ndarray, task_reward: float, info: dict[str, Any]) -> bool:
    """Whether a step of the simulation diverged or gave something that is no number."""
    return bool(info[DIVERGED] or not np.isfinite(task_reward) or not np.isfinite(observation).all())


def measure_episode(
    action: np.ndarray, next_observation: np.ndarray, task_reward: np.ndarray, solved: bool, observation: str
) -> dict[str, float]:
    """success; mean and mean distance to the target of every cs-reward's measure; task_reward; over steps [n, ...]."""
    raw = torch.from_numpy(OBSERVATION_MAPS[observation].invert(next_observation.astype(np.float64)))
    transitions = Transitions(
        raw, torch.from_numpy(action.astype(np.float64)), raw, torch.from_numpy(task_reward.astype(np.float64))
    )
    measures = {name: (reward.measure(transitions), reward.target) for name, reward in COMMON_SENSE_REWARDS.items()}
    means = {name: float(measure.mean()) for name, (measure, _) in measures.items()}
    distances = {
        distance_metric(name): float((measure - target).abs().mean()) for name, (measure, target) in measures.items()
    }
    return {"success": float(solved), **means, **distances, "task_reward": float(task_reward.mean())}


class Evaluated(NamedTuple):
    """Whose evaluation a folder holds."""

    task: str
    target: int
    cs_reward: str
    seed: int


def evaluated(folder: Path | str) -> Evaluated | None:
    """Which agent's evaluation is in ``folder``; None without an ``evaluation.csv``.

    Raises:
        UserError: the file is unreadable or holds several agents.
    """
    file = Path(folder) / "evaluation.csv"
    if not file.is_file():
        return None
    agents = storage.read_csv(file, COLUMNS)[list(Evaluated._fields)].drop_duplicates()
    if len(agents) != 1:
        raise UserError(f"{file}: holds {len(agents)} agents; one is expected, so make it again")
    task, target, cs_reward, seed = agents.iloc[0]
    return Evaluated(str(task), int(target), str(cs_reward), int(seed))


def check_agent(folder: Path | str, task: str, target: int, cs_reward: str) -> Evaluated | None:
    """Whose evaluation a folder holds, refused if another agent's; ``cs_reward`` is "" for plain SAC.

    Raises:
        UserError: the agent was trained on another task, target or cs-reward.
    """
    found = evaluated(folder)
    if found is not None and found[:3] != (task, target, cs_reward):
        wanted = f"{_kind(cs_reward)} on {task}-t{target}"
        raise UserError(f"{folder}: holds {_kind(found.cs_reward)} on {found.task}-t{found.target}, not {wanted}")
    return found


def _kind(cs_reward: str) -> str:
    return f"an expert of {cs_reward}" if cs_reward else "an agent without a cs-reward"
