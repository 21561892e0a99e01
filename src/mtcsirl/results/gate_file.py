"""``gate.json`` of a run, read by what shows it."""

from pathlib import Path
from typing import Any

from mtcsirl.errors import UserError
from mtcsirl.files import storage

KINDS: dict[str, Any] = {"passed": bool, "success": float | int | None, "metric": float | int | None}
"""What a gate says of an agent; any text as ``passed`` would count as yes."""


def read_verdict(gate: Path) -> dict[str, Any]:
    """What the gate says of the run, and in ``members`` of each of its agents, if it has several.

    Raises:
        UserError: the file is unreadable or no gate's.
    """
    verdict: dict[str, Any] = storage.read_json(gate)
    members = verdict.get("members", []) if isinstance(verdict, dict) else None
    if not isinstance(members, list) or not all(_is_verdict(one) for one in (verdict, *members)):
        raise UserError(f"{gate}: not the verdict of a gate; delete it and make its run again")
    return verdict


def _is_verdict(said: Any) -> bool:
    fits = isinstance(said, dict) and all(name in said and isinstance(said[name], KINDS[name]) for name in KINDS)
    return fits and isinstance(said.get("diverged", 0), int)
