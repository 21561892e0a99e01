"""Stage ``learn_reward``: Algorithm 1 or 2 over one file of demonstrations per task and target."""

from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

from mtcsirl.episodes.demonstrations import member_of
from mtcsirl.irl.run import learn_reward as run_irl
from mtcsirl.settings.runs import IrlRunSettings
from mtcsirl.stages.running import Task, look_at, running
from mtcsirl.study.keys import identity
from mtcsirl.study.runs import demonstrations_role

STAGE = "learn_reward"


class Learning(NamedTuple):
    """Which reward is learned; ``source`` names the task, or is "all"."""

    experiment: str
    method: str
    cs_reward: str
    source: str
    seed: int


def experiment_of(members: Sequence[tuple[str, int]]) -> tuple[str, str]:
    """Experiment and source of a reward that is learned from these tasks and targets."""
    tasks = {task for task, _ in members}
    if len(tasks) > 1:
        return "multi_task", "all"
    return ("multi_target" if len(members) > 1 else "single_target"), members[0][0]


def learn_reward(
    settings: IrlRunSettings,
    learning: Learning,
    demonstrations: Sequence[Path],
    output: Path,
    *,
    wanted: str | None = None,
    workers: int = 0,
) -> None:
    """Learn the reward from files of demonstrations into the folder ``output``; ``workers`` step the environments."""
    shown = {demonstrations_role(index, *member_of(file)): file for index, file in enumerate(demonstrations)}
    inputs = {role: look_at(file.parent, [file.name]) for role, file in shown.items()}
    made_from = identity(STAGE, learning._asdict(), settings, {role: one.hash for role, one in inputs.items()})
    task = Task(made_from, settings, output, {role: one.bytes for role, one in inputs.items()}, shown, wanted)
    with running(task) as stopwatch:
        if stopwatch is not None:
            about = {"experiment": learning.experiment, "source": learning.source}
            run_irl(
                output,
                learning.method,
                learning.cs_reward,
                demonstrations,
                learning.seed,
                settings,
                about=about,
                run=made_from.hash,
                stopwatch=stopwatch,
                workers=workers,
            )
