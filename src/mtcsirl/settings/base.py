"""The base of all settings and the one way to declare a key."""

from typing import Any

from pydantic import BaseModel, ConfigDict, Field

NOT_GIVEN = "not given"


class Frozen(BaseModel):
    """Validated, immutable settings; a key that does not exist is an error."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)


def key(default: Any, text: str, *, unit: str = "", paper: Any = NOT_GIVEN, **limits: Any) -> Any:
    """Declare one settings key.

    ``text`` says what it is, ``unit`` its unit, ``paper`` the paper's value (``NOT_GIVEN`` where the paper is
    silent). All three end up in the schema, in the comments of ``config/config.yaml`` and in ``deviations``.
    ``limits`` are pydantic's (``gt``, ``ge``, ``le``, ``min_length``, ...).
    """
    extra = {"unit": unit, "paper": paper}
    if callable(default):
        return Field(default_factory=default, description=text, json_schema_extra=extra, **limits)
    return Field(default=default, description=text, json_schema_extra=extra, **limits)
