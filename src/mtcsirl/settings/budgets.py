"""Task names, and numbers that are granted to every task but differ for some."""

from collections.abc import Mapping
from typing import Annotated, TypeVar

from pydantic import AfterValidator, Field

from mtcsirl.names import EXPERIMENTS, TASKS


def known_task(name: str) -> str:
    """``name``, or ValueError: Meta-World has no such task."""
    if name not in TASKS:
        raise ValueError(
            f"unknown task {name!r}; allowed: Meta-World's names without '-v3', e.g. {', '.join(TASKS[:6])}, ..."
        )
    return name


Number = TypeVar("Number", int, float)


def known_keys(budget: dict[str, Number]) -> dict[str, Number]:
    """``budget``, or ValueError: no default or an unknown task."""
    if "default" not in budget:
        raise ValueError("needs the key 'default'")
    for name in budget:
        if name != "default":
            known_task(name)
    return budget


def every_experiment(counts: dict[str, int]) -> dict[str, int]:
    """``counts``, or ValueError: an experiment is missing or unknown."""
    if set(counts) != set(EXPERIMENTS):
        raise ValueError(f"needs exactly the keys {', '.join(EXPERIMENTS)}")
    return counts


Task = Annotated[str, AfterValidator(known_task)]
Budget = Annotated[dict[str, Annotated[int, Field(gt=0)]], AfterValidator(known_keys)]
"""Environment steps: the key ``default`` and one key per task that differs."""
Iterations = Annotated[dict[str, Annotated[int, Field(ge=0)]], AfterValidator(known_keys)]
"""Iterations of IRL, likewise; none is allowed."""
Shares = Annotated[dict[str, Annotated[float, Field(ge=0, le=1)]], AfterValidator(known_keys)]
"""Shares in [0, 1], likewise."""

Updates = Annotated[dict[str, Annotated[int, Field(gt=0)]], AfterValidator(every_experiment)]
"""Updates per iteration, one number for each experiment."""


def granted(budget: Mapping[str, Number], task: str) -> Number:
    """What ``budget`` grants to ``task``."""
    return budget.get(task, budget["default"])
