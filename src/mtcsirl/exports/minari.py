"""Demonstrations as a Minari dataset, for tools that read those."""

import os
import warnings
from pathlib import Path
from typing import Any

import numpy as np

from mtcsirl.episodes.demonstrations import read_demonstrations
from mtcsirl.errors import UserError
from mtcsirl.worlds.environments import ACTION_SIZE, OBSERVATION_SIZE


def export_minari(demonstrations: Path | str, folder: Path | str, name: str | None = None) -> str:
    """Write ``demonstrations`` as a Minari dataset below ``folder`` and return its id.

    Observations [39] are in Meta-World's raw units, the reward is r_task, every episode ends by truncation, and the
    infos hold ``success`` per step.

    Raises:
        UserError: Minari is not installed, the file is not readable, or the dataset exists.
    """
    os.environ["MINARI_DATASETS_PATH"] = str(Path(folder).resolve())
    try:
        import minari
        from minari.data_collector import EpisodeBuffer
    except ImportError as error:
        raise UserError("Minari is not installed: pip install 'mtcsirl[export]'") from error
    frame = read_demonstrations(demonstrations)
    task, target = frame["task"].iloc[0], int(frame["target"].iloc[0])
    name = name or f"mtcsirl/{task}-t{target}-v0"
    if name in minari.list_local_datasets():
        raise UserError(f"{folder}: already holds {name}; choose another --name or delete it")
    buffers = []
    for episode, steps in frame.groupby("episode", sort=True):
        observations = np.stack([*steps["observation"], steps["next_observation"].iloc[-1]]).astype(np.float64)
        truncated = np.arange(len(steps)) == len(steps) - 1
        buffers.append(
            EpisodeBuffer(
                id=int(str(episode)),
                observations=list(observations),
                actions=list(np.stack(steps["action"].to_list()).astype(np.float32)),
                rewards=steps["task_reward"].astype(float).to_list(),
                terminations=[False] * len(steps),
                truncations=truncated.tolist(),
                infos={"success": [False, *steps["success"].astype(bool)]},
            )
        )
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # it asks for an environment id and an address, which there are not
        _create(minari, name, buffers, task, target)
    return name


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
