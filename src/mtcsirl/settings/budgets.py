"""Task names, and numbers that are granted to every task but differ for some."""

from typing import Annotated

from pydantic import AfterValidator, Field

from mtcsirl.tasks import TASKS


def known_task(name: str) -> str:
    """``name``, or ValueError: Meta-World has no such task."""
    if name not in TASKS:
        raise ValueError(
            f"unknown task {name!r}; allowed: Meta-World's names without '-v3', e.g. {', '.join(TASKS[:6])}, ..."
        )
    return name


def known_keys(budget: dict[str, int]) -> dict[str, int]:
    """``budget``, or ValueError: no default or an unknown task."""
    if "default" not in budget:
        raise ValueError("needs the key 'default'")
    for name in budget:
        if name != "default":
            known_task(name)
    return budget


Task = Annotated[str, AfterValidator(known_task)]
Budget = Annotated[dict[str, Annotated[int, Field(gt=0)]], AfterValidator(known_keys)]
"""Environment steps: the key ``default`` and one key per task that differs."""
Iterations = Annotated[dict[str, Annotated[int, Field(ge=0)]], AfterValidator(known_keys)]
"""Iterations of IRL, likewise; none is allowed."""


def granted(budget: dict[str, int], task: str) -> int:
    """What ``budget`` grants to ``task``."""
    return budget.get(task, budget["default"])
