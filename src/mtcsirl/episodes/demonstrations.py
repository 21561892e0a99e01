"""Expert demonstrations: stochastic episodes as Parquet, and back as one tensor over tasks.

One row per transition, observations in Meta-World's raw units, so that any observation map can be applied later.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import gymnasium
import numpy as np
import torch

from mtcsirl.episodes.evaluation import broken, measure_episode
from mtcsirl.episodes.policy import Policy, finite_action
from mtcsirl.errors import UserError
from mtcsirl.files.storage import read_parquet
from mtcsirl.names import DIVERGED
from mtcsirl.settings.runs import DemonstrationRunSettings
from mtcsirl.transitions import Transitions
from mtcsirl.worlds.environments import ACTION_SIZE, OBSERVATION_MAPS, OBSERVATION_SIZE, make_environment

if TYPE_CHECKING:
    import pandas as pd

VECTORS = {"observation": OBSERVATION_SIZE, "action": ACTION_SIZE, "next_observation": OBSERVATION_SIZE}
_STEP = (*VECTORS, "task_reward", "success")
COLUMNS = (*VECTORS, "task_reward", "task", "target", "cs_reward", "episode", "step", "success")


def collect_demonstrations(
    policy: Policy,
    task: str,
    target: int,
    settings: DemonstrationRunSettings,
    *,
    seed: int | Sequence[int],
    cs_reward: str = "",
) -> pd.DataFrame:
    """Episodes of the stochastic ``policy`` on one task and target, as a frame with ``COLUMNS``.

    The paper's experts are SAC policies; a deterministic one could not hover at an action norm of 3. ``cs_reward``:
    what the policy was trained with, "" for none. Whole episodes are numbered from 0; those whose simulation diverged
    follow them, with their steps before that, so that none is dropped and none is taken for a whole one.

    Raises:
        UserError: an action is not finite; more episodes diverged than are asked for.
    """
    import pandas as pd

    random = np.random.default_rng(seed)
    environment = make_environment(task, target, observation="raw", target_seed=settings.environment.target_seed)
    who = f"policy of {task}-t{target}"
    whole: list[list[tuple[Any, ...]]] = []
    cut: list[list[tuple[Any, ...]]] = []
    while len(whole) < settings.episodes:
        steps = _episode(policy, environment, settings.episode_steps, random, who)
        (whole if len(steps) == settings.episode_steps else cut).append(steps)
        if len(cut) > settings.episodes:
            raise UserError(f"{who}: the simulation diverged in {len(cut)} of {len(cut) + len(whole)} episodes")
    environment.close()
    frames = [
        pd.DataFrame(steps, columns=list(_STEP)).assign(episode=episode, step=range(len(steps)))
        for episode, steps in enumerate(whole + cut)
    ]
    return pd.concat(frames, ignore_index=True).assign(task=task, target=target, cs_reward=cs_reward)[list(COLUMNS)]


def _episode(
    policy: Policy, environment: gymnasium.Env, length: int, random: np.random.Generator, who: str
) -> list[tuple[Any, ...]]:
    """The steps of one episode, each with the values of ``_STEP``; fewer than ``length`` if the simulation diverged."""
    seen = OBSERVATION_MAPS[policy.observation]
    observation, _ = environment.reset()
    steps: list[tuple[Any, ...]] = []
    for step in range(length):
        action = finite_action(policy, seen.apply(observation), random, f"{who}: step {step}")
        after, reward, _, _, info = environment.step(action)
        if broken(after, float(reward), info):
            break
        steps.append((observation, action, after, reward, info["success"]))
        observation = after
    return steps


def demonstrated(frame: pd.DataFrame) -> dict[str, float]:
    """Means of ``measure_episode`` over the episodes of a frame with ``COLUMNS``, and how many of them diverged.

    An episode that diverged, which is one shorter than the others, is a failure.
    """
    length, episodes = _length(frame), []
    for _, rows in frame.groupby("episode"):
        action, following = (np.stack(rows[name].to_list()) for name in ("action", "next_observation"))
        whole = len(rows) == length
        solved = whole and bool(rows["success"].any())
        measured = measure_episode(action, following, rows["task_reward"].to_numpy(), solved, "raw")
        episodes.append(measured | {DIVERGED: float(not whole)})
    means = {metric: float(np.mean([episode[metric] for episode in episodes])) for metric in episodes[0]}
    return means | {DIVERGED: float(sum(episode[DIVERGED] for episode in episodes))}


def whole_episodes(frame: pd.DataFrame) -> pd.DataFrame:
    """The rows of the episodes that did not diverge."""
    sizes = frame.groupby("episode")["step"].transform("size")
    return frame[sizes == _length(frame)]


def _length(frame: pd.DataFrame) -> int:
    return int(frame.groupby("episode").size().max())


def as_transitions(frame: pd.DataFrame, observation: str) -> Transitions:
    """Rows [N] of a frame with ``COLUMNS`` as float32 transitions [N], seen through an observation map.

    Raises:
        ValueError: a vector has the wrong length, a value is not finite, or an action lies outside of [-1, 1].
    """
    vectors = {}
    for name, size in VECTORS.items():
        array = np.stack(frame[name].to_list()).astype(np.float32)
        if array.shape != (len(frame), size) or not np.isfinite(array).all():
            raise ValueError(f"column {name} does not hold {size} finite numbers per row")
        vectors[name] = torch.from_numpy(array)
    if vectors["action"].abs().max() > 1.0:
        raise ValueError("column action holds an action outside of [-1, 1]")
    task_reward = frame["task_reward"].to_numpy(np.float32, copy=True)
    if not np.isfinite(task_reward).all():
        raise ValueError("column task_reward holds a number that is not finite")
    seen = OBSERVATION_MAPS[observation]
    return Transitions(
        seen.apply(vectors["observation"]),
        vectors["action"],
        seen.apply(vectors["next_observation"]),
        torch.from_numpy(task_reward),
    )


class Demonstrations(NamedTuple):
    """The demonstrations of T tasks."""

    members: tuple[tuple[str, int], ...]
    """(task, target) of each."""
    transitions: Transitions
    """[T, N], as the agent sees them."""


def load_demonstrations(
    files: Sequence[Path | str], *, episodes: int, observation: str, cs_reward: str
) -> Demonstrations:
    """The first ``episodes`` episodes of each of T files, one file per (task, target).

    Raises:
        UserError: a file is missing, truncated, lacks a column, holds several tasks or targets, one that another file
            holds, too few whole episodes, unreadable numbers, or experts of another cs-reward than ``cs_reward``.
    """
    loaded: dict[tuple[str, int], Transitions] = {}
    for file in files:
        frame = read_parquet(file, COLUMNS)
        member = _member(file, frame)
        if member in loaded:
            raise UserError(f"{file}: a second file for {member[0]}-t{member[1]}; give one per task and target")
        _check_cs_reward(file, frame, cs_reward)
        loaded[member] = _first_episodes(file, frame, episodes, observation)
    sizes = sorted({len(part.task_reward) for part in loaded.values()})
    if len(sizes) != 1:
        raise UserError(f"demonstrations: {sizes} transitions per task; give files with episodes of one length")
    return Demonstrations(tuple(loaded), Transitions(*(torch.stack(p) for p in zip(*loaded.values(), strict=True))))


def read_demonstrations(file: Path | str) -> pd.DataFrame:
    """All rows of a file of demonstrations, checked.

    Raises:
        UserError: as in ``load_demonstrations``.
    """
    frame = read_parquet(file, COLUMNS)
    _member(file, frame)
    _checked(file, frame, "raw")
    return frame


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


def _check_cs_reward(file: Path | str, frame: pd.DataFrame, cs_reward: str) -> None:
    found = sorted(set(frame["cs_reward"].astype(str)))
    if found != [cs_reward]:
        said = " and ".join(name or "no cs-reward" for name in found)
        raise UserError(f"{file}: demonstrated by an expert of {said}, not of {cs_reward}; give that one's file")


def _first_episodes(file: Path | str, frame: pd.DataFrame, episodes: int, observation: str) -> Transitions:
    sizes = frame.groupby("episode").size()
    available = int((sizes == sizes.max()).sum())
    if available < episodes:
        raise UserError(
            f"{file}: has {available} episodes of {sizes.max()} steps, {episodes} are asked for; collect more or lower "
            "the number"
        )
    first = frame[frame["episode"] < episodes]
    expected = np.arange(episodes).repeat(sizes.max()), np.tile(np.arange(sizes.max()), episodes)
    if not all(np.array_equal(first[name], wanted) for name, wanted in zip(("episode", "step"), expected, strict=True)):
        raise UserError(f"{file}: an episode lacks steps or has them out of order; collect the demonstrations again")
    return _checked(file, first, observation)


def _checked(file: Path | str, frame: pd.DataFrame, observation: str) -> Transitions:
    try:
        return as_transitions(frame, observation)
    except (ValueError, TypeError) as error:
        raise UserError(f"{file}: not readable as demonstrations ({error}); collect them again") from error
