"""The base of all settings and the one way to declare a key."""

from typing import Any

from pydantic import BaseModel, ConfigDict, Field

NOT_GIVEN = "not given"


class Frozen(BaseModel):
    """Validated, immutable settings; a key that does not exist is an error."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)


ALWAYS = "always"
"""An ``absent`` that stands for no value: the key always counts."""


def key(
    default: Any,
    text: str,
    *,
    unit: str = "",
    paper: Any = NOT_GIVEN,
    absent: Any = ALWAYS,
    neutral: bool = False,
    **limits: Any,
) -> Any:
    """Declare one settings key.

    ``text`` says what it is, ``unit`` its unit, ``paper`` the paper's value (``NOT_GIVEN`` where the paper is
    silent). All three end up in the schema, in the comments of ``config/config.yaml`` and in ``deviations``.
    ``absent``: the value at which the key is no part of a run's identity; give a new key the value that stands for how
    things were without it, so that no finished run becomes stale. ``neutral``: the key changes no number, whatever its
    value. ``limits`` are pydantic's (``gt``, ``ge``, ``le``, ``min_length``, ...).
    """
    extra = {"unit": unit, "paper": paper, "absent": absent, "neutral": neutral}
    if callable(default):
        return Field(default_factory=default, description=text, json_schema_extra=extra, **limits)
    return Field(default=default, description=text, json_schema_extra=extra, **limits)


def identifying(settings: BaseModel) -> dict[str, Any]:
    """``settings`` as plain data without keys that are neutral or have the value at which they are absent."""
    said: dict[str, Any] = {}
    plain = settings.model_dump(mode="json")
    for name, field in type(settings).model_fields.items():
        extra = field.json_schema_extra if isinstance(field.json_schema_extra, dict) else {}
        value = getattr(settings, name)
        if isinstance(value, BaseModel):
            said[name] = identifying(value)
        elif not extra.get("neutral", False) and plain[name] != extra.get("absent", ALWAYS):
            said[name] = plain[name]
    return said
