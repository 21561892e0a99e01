"""What an entry of an extension must be: its name, and a common-sense reward tried on a handful of transitions.

Every function raises a UserError that says what is wrong and what it should be; whoever calls it names the entry.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from numbers import Real
from typing import TYPE_CHECKING, Any

from mtcsirl import names
from mtcsirl.errors import UserError
from mtcsirl.rewards.ground_truth import CommonSenseReward, action_norm, velocity
from mtcsirl.transitions import Transitions

if TYPE_CHECKING:
    import torch

_NAME = re.compile(r"[a-z][a-z0-9_]*")
_DISTANCE = names.distance_metric("")
_TAKEN = {
    "METHODS": {*names.AGENTS, "all"},
    "COMMON_SENSE_REWARDS": {*names.QUANTITIES, names.DIVERGED},
}
"""Names that rows, tables and figures have given to something else."""
_OBJECT = (0.0, 0.7, 0.02, 0.0, 0.0, 0.0, 1.0)
_NOW, _BEFORE = (0.0, 0.6, 0.2, 0.9, *_OBJECT, *_OBJECT), (0.003, 0.598, 0.204, 1.0, *_OBJECT, *_OBJECT)
_OBSERVATION = (*_NOW, *_BEFORE, 0.1, 0.8, 0.2)
"""A raw observation [39] of a hand that moves at 0.4 m/s beside an object."""
_SHOWN = 80
"""Characters of a value that a line shows."""
_ACTION = (0.5, -0.3, 0.2, 0.8)


def must(holds: bool, found: str, wanted: str) -> None:
    """Raise UserError unless ``holds``."""
    if not holds:
        raise UserError(f"{found}; must be {wanted}")


def shown(value: object) -> str:
    """A value as a part of one line."""
    text = " ".join(repr(value).split())
    return text if len(text) <= _SHOWN else f"{text[:_SHOWN]}..."


@contextmanager
def attempted(what: str, wanted: str = "") -> Iterator[None]:
    """Run code of a user; whatever it raises, and its ``sys.exit``, becomes a UserError of one line."""
    try:
        yield
    except SystemExit as error:
        if error.__class__ is not SystemExit:  # a signal that ends this process
            raise
        raise UserError(f"{what}: ends the program (sys.exit); an extension must not") from error
    except Exception as error:
        says = " ".join(str(error).split())
        raise UserError(f"{what}: {type(error).__name__}: {says}" + (f"; {wanted}" if wanted else "")) from error


def check_name(kind: str, name: Any) -> None:
    """A name is part of folders, of wildcards and of the columns of tables."""
    good = isinstance(name, str) and _NAME.fullmatch(name) is not None
    must(good, "is no name", "lower-case letters, digits and underscores, a letter first")
    must(name not in _TAKEN[kind], "is the name of something else in tables and figures", "another name")
    metric = kind == "COMMON_SENSE_REWARDS" and name.endswith(_DISTANCE)
    must(not metric, f"ends in {_DISTANCE}, as the distance of another cs-reward to its target does", "another name")


def check_reward(name: str, entry: Any) -> None:
    """A common-sense reward: its values, and what it measures of a few transitions."""
    must(isinstance(entry, CommonSenseReward), f"is {shown(entry)}", "a CommonSenseReward")
    must(entry.name == name, f"name = {shown(entry.name)}", f"the key under which it stands, {name!r}")
    must(_positive(entry.target), f"target = {shown(entry.target)}", "a finite number above 0 (gates divide by it)")
    must(_positive(entry.weight), f"weight = {shown(entry.weight)}", "a finite number above 0")
    must(isinstance(entry.unit, str), f"unit = {shown(entry.unit)}", "a text")
    must(callable(entry.measure), f"measure = {shown(entry.measure)}", "a function of transitions")
    if entry.measure not in (velocity, action_norm):  # the package's own need no probe, which imports torch
        _probe(entry)


def _positive(value: Any) -> bool:
    return isinstance(value, Real) and not isinstance(value, bool) and 0 < float(value) < math.inf


def _probe(reward: CommonSenseReward) -> None:
    """Measure transitions as training ([agents, minibatch], float32) and evaluation ([steps], float64) have them."""
    import torch

    for shape, dtype in (((2, 3), torch.float32), ((5,), torch.float64)):
        wanted = f"a tensor of shape {list(shape)} for transitions {[*shape, '*']}".replace("'", "")
        with attempted("measure", f"must return {wanted}"), torch.random.fork_rng(devices=[]):
            value = reward.measure(_handful(shape, dtype))
        check_tensor("measure", value, shape, wanted)


def check_tensor(what: str, value: Any, shape: Sequence[int], wanted: str) -> None:
    """A floating-point tensor of this shape whose numbers are finite."""
    import torch

    kind = f"{type(value).__module__}.{type(value).__qualname__}".removeprefix("builtins.")
    must(isinstance(value, torch.Tensor), f"{what} returns a {kind}", wanted)
    must(list(value.shape) == list(shape), f"{what} returns a tensor of shape {list(value.shape)}", wanted)
    must(value.is_floating_point(), f"{what} returns {value.dtype}", "floating-point numbers")
    finite = bool(value.isfinite().all())
    must(finite, f"{what} returns {value.flatten().tolist()[:3]} for ordinary transitions", "finite numbers")


def _handful(shape: Sequence[int], dtype: torch.dtype) -> Transitions:
    import torch

    def rows(values: Sequence[float]) -> torch.Tensor:
        count = math.prod(shape)
        scale = torch.linspace(0.9, 1.1, count, dtype=dtype).unsqueeze(-1)
        return (scale * torch.tensor(values, dtype=dtype)).reshape(*shape, len(values))

    after = rows(_OBSERVATION)
    return Transitions(after, rows(_ACTION), after.clone(), rows((2.0,)).squeeze(-1))
