"""Files of a run that a user names, looked at before a stage begins: its readers take for granted who wrote them.

What is wrong is said with the remedy of the readers, which a verb replaces where the file is a user's own.
"""

import math
import numbers
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

from mtcsirl.errors import UserError
from mtcsirl.files import storage
from mtcsirl.names import TARGETS_PER_TASK, TASKS


def check_demonstrations(file: Path | str, *, success: bool = False) -> None:
    """Raise UserError where ``file`` holds what ``collect_demonstrations`` writes into no row.

    Of the columns that say what a transition is of; with ``success`` that one too. Vectors and rewards are left to the
    readers.
    """
    columns = ("task", "target", "cs_reward", "episode", "step", *(["success"] if success else []))
    frame = storage.read_parquet(file, columns)
    _check(file, "task", frame["task"], _is_task, "a task of Meta-World")
    _check(file, "target", frame["target"], _is_target, f"a target (0 ... {TARGETS_PER_TASK - 1})")
    _check(file, "cs_reward", frame["cs_reward"], lambda value: isinstance(value, str), "a name")
    for name in ("episode", "step"):
        _check(file, name, frame[name], _is_whole, "a whole number")
    if success:
        _check(file, "success", frame["success"], _is_flag, "true or false")


def check_evaluation(folder: Path | str) -> None:
    """Raise UserError where the ``evaluation.csv`` in ``folder``, if there is one, names no target or seed in a row."""
    file = Path(folder) / "evaluation.csv"
    if file.is_file():
        frame = storage.read_csv(file, ("target", "seed"))
        for name in ("target", "seed"):
            _check(file, name, frame[name], _is_whole, "a whole number")


def _check(file: Path | str, name: str, column: Iterable[Any], fits: Callable[[Any], bool], what: str) -> None:
    for value in column:
        if not fits(value):
            raise UserError(f"{file}: column {name} holds {str(value)[:40]!r}, not {what}; delete it and make it again")


def _is_task(value: Any) -> bool:
    return isinstance(value, str) and value in TASKS


def _is_target(value: Any) -> bool:
    return _is_whole(value) and value < TARGETS_PER_TASK


def _is_flag(value: Any) -> bool:
    return isinstance(value, bool) or (_is_whole(value) and value <= 1)


def _is_whole(value: Any) -> bool:
    """Whether a value is one of 0, 1, 2, ..., which a column with gaps holds as floats."""
    if isinstance(value, bool) or not isinstance(value, numbers.Real):
        return False
    number = float(value)
    return math.isfinite(number) and number >= 0 and number.is_integer()
