"""The registry of IRL methods: name -> what builds it. A new method is one file here and one name below.

The file ``<name>.py`` holds a function ``<name>``; it is imported when the method is built, so that a configuration can
be checked against this registry without torch.
"""

from __future__ import annotations

from collections.abc import Callable
from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from mtcsirl.irl.discriminator import Method
    from mtcsirl.irl.methods.base import Setup


def _builder(name: str) -> Callable[[Setup], Method]:
    def build(setup: Setup) -> Method:
        method: Method = getattr(import_module(f"mtcsirl.irl.methods.{name}"), name)(setup)
        return method

    return build


METHODS: dict[str, Callable[[Setup], Method]] = {
    name: _builder(name)
    for name in (
        "mt_airl",
        "mt_vairl",
        "mt_vairl_gp",
        "mt_csirl",
        "mt_csirl_lt",
    )
}
