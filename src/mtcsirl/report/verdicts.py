"""The claims of ``claims.json`` as the page shows them."""

from pathlib import Path
from typing import Any

from mtcsirl.claims.claims import GATE
from mtcsirl.claims.judging import SHOWN
from mtcsirl.claims.unit_text import power_text
from mtcsirl.errors import UserError
from mtcsirl.report.content import Claim, UnitLine
from mtcsirl.report.measured import measured


def claims_of(judged: dict[str, Any], path: Path | str = "claims.json") -> tuple[Claim, ...]:
    """The claims of ``claims.json``.

    Raises UserError when they are something else.
    """
    try:
        return tuple(_claim(found) for found in judged["claims"])
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        raise UserError(f"{path}: not the claims of this suite ({error}); delete it and make it again") from error


def _claim(found: dict[str, Any]) -> Claim:
    texts = {name: found[name] for name in ("name", "text", "locus", "criterion", "verdict", "reason")}
    return Claim(
        **texts,
        units=tuple(map(_unit, found["units"])),
        measured=measured(found["units"]),
        gate=found["role"] == GATE,
        departures=tuple((departure["leans"], departure["text"]) for departure in found["departures"]),
    )


def _unit(found: dict[str, Any]) -> UnitLine:
    power = "" if found["power"] is None else power_text(found["power"])
    return UnitLine(
        texts=found["texts"],
        state=found["answer"],
        outcome=found["outcome"],
        value=found["measure"]["value"],
        remarks=tuple(filter(None, [power, *found["notes"]])),
        judged=found["answer"] != SHOWN,
        folders=tuple(found["folders"]),
    )
