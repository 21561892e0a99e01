"""What the settings classes say about themselves: commented configuration, schema, deviations from the paper."""

import json
import textwrap
from collections.abc import Iterator
from typing import Any, NamedTuple

import yaml
from pydantic import BaseModel
from pydantic.fields import FieldInfo

from mtcsirl.settings.base import NOT_GIVEN
from mtcsirl.settings.configuration import Settings

WIDTH = 120
HEAD = """\
# The configuration of the whole study, scale desk. Written by `mtcsirl settings defaults` from the classes in
# src/mtcsirl/settings/, which hold the defaults: a key left out takes the value that stands here.
#
# Above each key: what it is [unit]; the paper's value, where the paper gives one. The values below that differ from
# the paper's are listed by `mtcsirl deviations` and printed under every table.
#
# Other scales and studies of your own are small overlays: snakemake --configfile config/smoke.yaml. An overlay merges
# mappings and replaces lists.
"""


class Deviation(NamedTuple):
    """One key whose value is not the paper's."""

    key: str
    ours: Any
    paper: Any
    unit: str
    text: str

    def __str__(self) -> str:
        """One line for a table's footer."""
        unit = f" {self.unit}" if self.unit else ""
        return f"{self.key} = {_flow(self.ours)}{unit} (paper: {_flow(self.paper)}): {self.text}"


def keys(settings: BaseModel, prefix: str = "") -> Iterator[tuple[str, FieldInfo, Any]]:
    """Every leaf key of ``settings`` as (dotted key, its declaration, its value), in the order of the classes."""
    for name, field in type(settings).model_fields.items():
        value = getattr(settings, name)
        if isinstance(value, BaseModel):
            yield from keys(value, f"{prefix}{name}.")
        else:
            yield prefix + name, field, value


def deviations(settings: BaseModel) -> list[Deviation]:
    """Every key of ``settings`` whose value differs from the one that the paper gives."""
    found = []
    for name, field, value in keys(settings):
        paper = _extra(field).get("paper", NOT_GIVEN)
        if paper != NOT_GIVEN and _plain(value) != _plain(paper):
            found.append(Deviation(name, value, paper, _extra(field).get("unit", ""), field.description or ""))
    return found


def fallbacks(settings: Settings) -> list[str]:
    """What a cs-reward that the configuration does not know gets, one line per key."""
    notes = []
    for name in settings.cs_rewards:
        if name not in settings.expert.cs_weight:
            notes.append(f"{name}: has no expert.cs_weight; its experts take 1.0")
        if f"expert_{name}" not in type(settings.gates).model_fields:
            notes.append(f"{name}: has no gate of its own; its experts take gates.expert_velocity")
    return notes


def template(settings: Settings | None = None) -> str:
    """``settings`` (default: the desk scale) as YAML in which every key is commented; loading it gives ``settings``."""
    return HEAD + "\n".join(_lines(settings or Settings(), "")) + "\n"


def as_json(settings: BaseModel, only: set[str] | None = None) -> str:
    """``settings`` (their keys ``only``) as one line of JSON with sorted keys: equal settings give equal text."""
    data = settings.model_dump(mode="json", include=only)
    return json.dumps(data, sort_keys=True, separators=(",", ":"), allow_nan=False)


def schema() -> dict[str, Any]:
    """The JSON schema of the configuration."""
    return Settings.model_json_schema()


def _lines(settings: BaseModel, indent: str) -> Iterator[str]:
    for name, field in type(settings).model_fields.items():
        value = getattr(settings, name)
        if not indent or isinstance(value, BaseModel):
            yield ""
        first, more = f"{indent}# ", f"{indent}#   "
        yield from textwrap.wrap(
            _comment(field), WIDTH, initial_indent=first, subsequent_indent=more, break_on_hyphens=False
        )
        if isinstance(value, BaseModel):
            yield f"{indent}{name}:"
            yield from _lines(value, indent + "  ")
        else:
            yield f"{indent}{name}: {_flow(value)}"


def _comment(field: FieldInfo) -> str:
    extra = _extra(field)
    unit = f" [{extra['unit']}]" if extra.get("unit") else ""
    paper = extra.get("paper", NOT_GIVEN)
    return f"{field.description}{unit}" + ("" if paper == NOT_GIVEN else f"; paper: {_flow(paper)}")


def _extra(field: FieldInfo) -> dict[str, Any]:
    extra = field.json_schema_extra
    return extra if isinstance(extra, dict) else {}


def _plain(value: Any) -> Any:
    """Lists instead of tuples, as YAML and JSON have it."""
    if isinstance(value, dict):
        return {name: _plain(item) for name, item in value.items()}
    if isinstance(value, tuple | list):
        return [_plain(item) for item in value]
    return value


def _flow(value: Any) -> str:
    """One line of YAML."""
    text = yaml.safe_dump(_plain(value), default_flow_style=True, width=10_000, sort_keys=False)
    return text.removesuffix("\n").removesuffix("\n...").strip()
