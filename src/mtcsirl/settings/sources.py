"""Where a key of the configuration was written: the overlay, or ``--set``, that a complaint names."""

from collections.abc import Mapping, Sequence
from typing import Any

Sources = Sequence[tuple[str, Mapping[str, Any]]]
"""What was merged, each with its name; later ones win."""
NOWHERE = "configuration"


def holder(key: str, sources: Sources) -> str:
    """The name of the last of ``sources`` that holds the dotted ``key``."""
    return next((name for name, data in reversed(sources) if key and _holds(data, key.split("."))), NOWHERE)


def _holds(data: Any, parts: Sequence[str]) -> bool:
    for part in parts:
        if isinstance(data, Mapping):
            known = {str(name): value for name, value in data.items()}
        else:
            known = dict(zip(map(str, range(len(data))), data, strict=True)) if isinstance(data, list | tuple) else {}
        if part not in known:
            return False
        data = known[part]
    return True
