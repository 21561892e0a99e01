"""Meta-World's own reward and pose code, run with faster helpers.

A task's methods are kept as they are; what changes is what three names in them refer to: ``Rotation`` (scipy's, which
spends 0.15 ms on one matrix), ``reward_utils`` (whose ``tolerance`` spends 10 us on one number in numpy calls made for
arrays) and ``np``, for ``np.linalg.norm`` (most of whose time goes to choosing the norm). The stand-ins return the same
bits for what the tasks pass.
"""

from types import FunctionType, ModuleType, SimpleNamespace
from typing import Any

import numpy as np
from metaworld.sawyer_xyz_env import SawyerMocapBase, SawyerXYZEnv
from metaworld.utils import reward_utils

from mtcsirl.worlds.fast.rotation import MatrixRotation
from mtcsirl.worlds.fast.tolerance import tolerance


def _norm(x: Any, *arguments: Any, **keywords: Any) -> Any:
    """Return ``np.linalg.norm`` of what is nearly always one vector of doubles."""
    if arguments or keywords or type(x) is not np.ndarray or x.dtype != np.float64 or not x.flags.c_contiguous:
        return np.linalg.norm(x, *arguments, **keywords)
    x = x.ravel()
    return np.sqrt(x.dot(x))


def _with(module: ModuleType, **changes: Any) -> SimpleNamespace:
    """Return what a module holds, with some of it changed."""
    return SimpleNamespace(**(vars(module) | changes))


_STAND_INS = {
    "Rotation": MatrixRotation,
    "reward_utils": _with(reward_utils, tolerance=tolerance),
    "np": _with(np, linalg=_with(np.linalg, norm=_norm)),
}


def with_faster_helpers(task_class: type[SawyerXYZEnv]) -> type[SawyerXYZEnv]:
    """Return a subclass of the task whose methods are the task's own, bound to the stand-ins."""
    definitions: dict[str, Any] = {}
    for owner in reversed(task_class.__mro__[: task_class.__mro__.index(SawyerMocapBase)]):
        definitions |= vars(owner)  # the most derived definition of each name wins
    methods = {
        name: _rebind(function)
        for name, function in definitions.items()
        if isinstance(function, FunctionType) and not _STAND_INS.keys().isdisjoint(function.__code__.co_names)
    }
    return type(task_class.__name__, (task_class,), methods)


def _rebind(function: FunctionType) -> FunctionType:
    """Return the same function looking its global names up with the stand-ins in place."""
    rebound = FunctionType(
        function.__code__,
        {**function.__globals__, **_STAND_INS},
        function.__name__,
        function.__defaults__,
        function.__closure__,
    )
    rebound.__kwdefaults__ = function.__kwdefaults__
    return rebound
