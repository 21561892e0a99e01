"""Demonstrations as a Minari dataset, for tools that read those."""

import os
import re
import tempfile
import warnings
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from mtcsirl.episodes.demonstrations import read_demonstrations
from mtcsirl.errors import UserError
from mtcsirl.study.inputs import check_demonstrations
from mtcsirl.worlds.environments import ACTION_SIZE, OBSERVATION_SIZE

NAME = re.compile(r"([A-Za-z0-9_-]+/)*[A-Za-z0-9_-]+-v[0-9]+")
"""Minari's ids; those that any file system and any of Minari's versions take."""


def export_minari(demonstrations: Path | str, folder: Path | str, name: str | None = None) -> str:
    """Write ``demonstrations`` as a Minari dataset below ``folder`` and return its id.

    Observations [39] are in Meta-World's raw units, the reward is r_task, every episode ends by truncation, and the
    infos hold ``success`` per step. The dataset appears as a whole or not at all.

    Raises:
        UserError: Minari is not installed, the id is none, the file is not readable or names no task and target of
            Meta-World, or the dataset exists.
    """
    folder = Path(folder)
    if name is not None:
        _check_name(name)
    check_demonstrations(demonstrations, success=True)
    frame = read_demonstrations(demonstrations)
    task, target = frame["task"].iloc[0], int(frame["target"].iloc[0])
    name = name or f"mtcsirl/{task}-t{target}-v0"
    if (folder / name).exists():
        raise UserError(f"{folder}: already holds {name}; choose another --name or delete it")
    folder.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(prefix=".minari-", dir=folder) as place:
        _write(Path(place), name, frame, task, target)
        for made in sorted(Path(place).rglob("namespace_metadata.json")):
            known = folder / made.relative_to(place)
            if not known.exists():
                known.parent.mkdir(parents=True, exist_ok=True)
                made.replace(known)
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (Path(place) / name).replace(folder / name)
    os.environ["MINARI_DATASETS_PATH"] = str(folder.resolve())  # where this process finds it now
    return name


def _check_name(name: str) -> None:
    """Minari's rule, and that the dataset lands below its folder."""
    if not NAME.fullmatch(name):
        raise UserError(
            f"--name {name}: must be letters, digits, - and _, with a version at the end, for example mine/reach-v0"
        )


def _write(root: Path, name: str, frame: pd.DataFrame, task: str, target: int) -> None:
    os.environ["MINARI_DATASETS_PATH"] = str(root.resolve())
    try:
        import minari
        from minari.data_collector import EpisodeBuffer
    except ImportError as error:
        raise UserError("Minari is not installed: pip install 'mtcsirl[export]'") from error
    buffers = [_episode(EpisodeBuffer, int(str(i)), steps) for i, steps in frame.groupby("episode", sort=True)]
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # it asks for an environment id and an address, which there are not
        _create(minari, name, buffers, task, target)


def _episode(kind: Any, number: int, steps: pd.DataFrame) -> Any:
    observations = np.stack([*steps["observation"], steps["next_observation"].iloc[-1]]).astype(np.float64)
    truncated = np.arange(len(steps)) == len(steps) - 1
    return kind(
        id=number,
        observations=list(observations),
        actions=list(np.stack(steps["action"].to_list()).astype(np.float32)),
        rewards=steps["task_reward"].astype(float).to_list(),
        terminations=[False] * len(steps),
        truncations=truncated.tolist(),
        infos={"success": [False, *steps["success"].astype(bool)]},
    )


def _create(minari: Any, name: str, buffers: list[Any], task: str, target: int) -> None:
    from gymnasium.spaces import Box

    minari.create_dataset_from_buffers(
        name,
        buffers,
        algorithm_name="SAC expert on task and common-sense reward",
        author="mtcsirl",
        description=f"Stochastic expert on Meta-World's {task}-v3, target {target}; reward: the task's.",
        observation_space=Box(-np.inf, np.inf, (OBSERVATION_SIZE,), np.float64),
        action_space=Box(-1.0, 1.0, (ACTION_SIZE,), np.float32),
    )
