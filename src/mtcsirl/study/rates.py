"""The rates of one machine, from which a plan works out what a run costs.

``study/calibration.json`` holds those that ship with the package; ``mtcsirl calibrate`` measures another machine's.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Annotated, TypeVar

import numpy as np
from pydantic import Field, field_validator

from mtcsirl.errors import UserError
from mtcsirl.files.given import as_given, check_given
from mtcsirl.files.storage import read_json
from mtcsirl.settings.base import Frozen
from mtcsirl.settings.loading import validate

CALIBRATION = Path(__file__).with_name("calibration.json")
DEFAULT = "default"
_NAME_ONE = "name a file that mtcsirl calibrate --output FILE wrote"
_AGAIN = "measure again by mtcsirl calibrate --output FILE, a new one"

Count = Annotated[int, Field(gt=0)]
Seconds = Annotated[float, Field(gt=0)]
"""No rate is zero, negative or infinite: whoever measured one has measured something else."""
ByMinibatch = Annotated[dict[Count, Seconds], Field(min_length=1)]


def _with_default(rates: dict[str, Named]) -> dict[str, Named]:
    if DEFAULT not in rates:
        raise ValueError(f"must have a rate named {DEFAULT}, for names that were not measured")
    return rates


class AgentRates(Frozen):
    """One agent's share of a training loop, among those that step together."""

    step: Seconds
    """Of an environment step all but the simulation: acting, storing, reporting."""
    update: ByMinibatch
    """A minibatch drawn, its rewards, one gradient step."""


class GeneratorRates(AgentRates):
    """One generator's share of an IRL run's loop."""

    discriminator_update: dict[str, ByMinibatch]
    """Of all discriminators of a method, minibatches drawn; by method."""
    density: Seconds
    """log pi of one transition under one policy, tabulated."""

    _named = field_validator("discriminator_update")(_with_default)


Loops = TypeVar("Loops", bound=AgentRates)
Named = TypeVar("Named")


class Rates(Frozen):
    """CPU seconds, measured on one idle core. Minibatches are keys of ``*update``."""

    machine: Annotated[str, Field(min_length=1)]
    start_up: Seconds
    """Of a job until its clock starts."""
    frames: Seconds
    """What a job imports later, to write its tables."""
    environment_step: dict[str, Seconds]
    episode_step: Seconds
    """A step of an episode outside of training, beside the simulation: acting, measuring."""
    recorded: Seconds
    """A transition recorded and written, beside ``episode_step``."""
    agents: Annotated[dict[Count, AgentRates], Field(min_length=1)]
    """By the number that train in lockstep."""
    generators: Annotated[dict[Count, GeneratorRates], Field(min_length=1)]
    """By the number in one IRL run."""
    scored: Seconds
    """One transition set of a score, without resamples."""
    resampled: Seconds
    """A transition in one resample of it."""
    slowdown: Annotated[float, Field(ge=1)]
    """Factor on everything when every core is busy."""

    _named = field_validator("environment_step")(_with_default)

    def simulated(self, task: str) -> float:
        """One step of the environment of ``task``."""
        return self.environment_step.get(task, self.environment_step[DEFAULT])


def by_minibatch(rates: Mapping[int, float], minibatch: int) -> float:
    """Seconds per update at ``minibatch``: linear between, and proportional beyond, the measured ones."""
    sizes = sorted(rates)
    if minibatch > sizes[-1]:
        return rates[sizes[-1]] * minibatch / sizes[-1]
    return float(np.interp(minibatch, sizes, [rates[size] for size in sizes]))


def share(loops: Mapping[int, Loops], count: int, rate: Callable[[Loops], float]) -> float:
    """A rate of one of ``count`` that step together: what is done once for all is spread over them, so linear in
    1/count between the measured counts."""
    counts = sorted(loops, reverse=True)
    return float(np.interp(1 / count, [1 / one for one in counts], [rate(loops[one]) for one in counts]))


def load_rates(path: Path | str = CALIBRATION) -> Rates:
    """The rates in a calibration file.

    Raises:
        UserError: the file is missing, empty or no JSON, or a rate is missing or cannot be.
    """
    check_given(path, missing=_NAME_ONE)
    with as_given(_NAME_ONE):
        said = read_json(path)
    if not isinstance(said, dict):
        raise UserError(f"{path}: holds no rates; {_NAME_ONE}")
    if missing := [name for name in Rates.model_fields if name not in said]:
        raise UserError(f"{path}: lacks {', '.join(missing)}; {_AGAIN}")
    try:
        return validate(Rates, said)
    except UserError as error:
        reason = str(error).removeprefix("configuration: ")
        raise UserError(f"{path}: {reason}; {_AGAIN}") from error
