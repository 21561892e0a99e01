"""Expert demonstrations: stochastic episodes as Parquet, and back as one tensor over tasks.

One row per transition, observations in Meta-World's raw units, so that any observation map can be applied later.
"""

from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pandas as pd
import torch

from mtcsirl.episodes.evaluation import measure_episode
from mtcsirl.episodes.policy import Policy
from mtcsirl.errors import UserError
from mtcsirl.files.storage import read_parquet
from mtcsirl.settings.runs import DemonstrationRunSettings
from mtcsirl.transitions import Transitions
from mtcsirl.worlds.environments import ACTION_SIZE, OBSERVATION_MAPS, OBSERVATION_SIZE, make_environment

VECTORS = {"observation": OBSERVATION_SIZE, "action": ACTION_SIZE, "next_observation": OBSERVATION_SIZE}
COLUMNS = (*VECTORS, "task_reward", "task", "target", "episode", "step", "success")


def collect_demonstrations(
    policy: Policy, task: str, target: int, settings: DemonstrationRunSettings, *, seed: int
) -> pd.DataFrame:
    """Episodes of the stochastic ``policy`` on one task and target, as a frame with ``COLUMNS``.

    The paper's experts are SAC policies; a deterministic one could not hover at an action norm of 3.
    """
    random = np.random.default_rng(seed)
    environment = make_environment(task, target, observation="raw", target_seed=settings.environment.target_seed)
    seen = OBSERVATION_MAPS[policy.observation]
    rows = []
    for episode in range(settings.episodes):
        observation, _ = environment.reset()
        for step in range(settings.episode_steps):
            action = policy.act(seen.apply(observation), random)
            after, reward, _, _, info = environment.step(action)
            rows.append((observation, action, after, reward, task, target, episode, step, info["success"]))
            observation = after
    environment.close()
    return pd.DataFrame(rows, columns=list(COLUMNS))


def demonstrated(frame: pd.DataFrame) -> dict[str, float]:
    """Means over the episodes of a frame with ``COLUMNS``: success, the measure of every cs-reward, task_reward."""
    episodes = []
    for _, rows in frame.groupby("episode"):
        action, following = (np.stack(rows[name].to_list()) for name in ("action", "next_observation"))
        solved = bool(rows["success"].any())
        episodes.append(measure_episode(action, following, rows["task_reward"].to_numpy(), solved, "raw"))
    return {metric: float(np.mean([episode[metric] for episode in episodes])) for metric in episodes[0]}


def as_transitions(frame: pd.DataFrame, observation: str) -> Transitions:
    """Rows [N] of a frame with ``COLUMNS`` as float32 transitions [N], seen through an observation map.

    Raises:
        ValueError: a vector has the wrong length, or a value is not finite.
    """
    vectors = {}
    for name, size in VECTORS.items():
        array = np.stack(frame[name].to_list()).astype(np.float32)
        if array.shape != (len(frame), size) or not np.isfinite(array).all():
            raise ValueError(f"column {name} does not hold {size} finite numbers per row")
        vectors[name] = torch.from_numpy(array)
    seen = OBSERVATION_MAPS[observation]
    return Transitions(
        seen.apply(vectors["observation"]),
        vectors["action"],
        seen.apply(vectors["next_observation"]),
        torch.from_numpy(frame["task_reward"].to_numpy(np.float32, copy=True)),
    )


class Demonstrations(NamedTuple):
    """The demonstrations of T tasks."""

    members: tuple[tuple[str, int], ...]
    """(task, target) of each."""
    transitions: Transitions
    """[T, N], as the agent sees them."""


def load_demonstrations(files: Sequence[Path | str], *, episodes: int, observation: str) -> Demonstrations:
    """The first ``episodes`` episodes of each of T files, one file per (task, target).

    Raises:
        UserError: a file is missing, truncated, lacks a column, holds several tasks or targets, one that another file
            holds, too few episodes or unreadable numbers.
    """
    loaded: dict[tuple[str, int], Transitions] = {}
    for file in files:
        frame = read_parquet(file, COLUMNS)
        member = _member(file, frame)
        if member in loaded:
            raise UserError(f"{file}: a second file for {member[0]}-t{member[1]}; give one per task and target")
        loaded[member] = _first_episodes(file, frame, episodes, observation)
    sizes = sorted({len(part.task_reward) for part in loaded.values()})
    if len(sizes) != 1:
        raise UserError(f"demonstrations: {sizes} transitions per task; give files with episodes of one length")
    return Demonstrations(tuple(loaded), Transitions(*(torch.stack(p) for p in zip(*loaded.values(), strict=True))))


def member_of(file: Path | str) -> tuple[str, int]:
    """Task and target of a file of demonstrations, whose transitions are not read.

    Raises:
        UserError: the file is missing, truncated, or holds several tasks or targets.
    """
    return _member(file, read_parquet(file, ("task", "target")))


def _member(file: Path | str, frame: pd.DataFrame) -> tuple[str, int]:
    found = sorted(set(zip(frame["task"], frame["target"].astype(int), strict=True)))
    if len(found) != 1:
        names = ", ".join(f"{task}-t{target}" for task, target in found) or "no transition"
        raise UserError(f"{file}: holds {names}; a file of demonstrations holds one task and target")
    return found[0]


def _first_episodes(file: Path | str, frame: pd.DataFrame, episodes: int, observation: str) -> Transitions:
    available = frame["episode"].nunique()
    if available < episodes:
        raise UserError(f"{file}: has {available} episodes, {episodes} are asked for; collect more or lower the number")
    try:
        return as_transitions(frame[frame["episode"] < episodes], observation)
    except (ValueError, TypeError) as error:
        raise UserError(f"{file}: not readable as demonstrations ({error}); collect them again") from error
