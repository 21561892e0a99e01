"""From YAML files and single overrides to validated settings; every mistake becomes one line."""

import difflib
from collections.abc import Iterable, Iterator, Mapping
from functools import reduce
from pathlib import Path
from typing import Any, TypeVar

from pydantic import BaseModel, ValidationError

from mtcsirl.errors import UserError
from mtcsirl.files.given import read_given
from mtcsirl.settings.configuration import Settings
from mtcsirl.settings.scale import check_scale
from mtcsirl.settings.sources import Sources, holder
from mtcsirl.settings.strict import StrictError, parse

Model = TypeVar("Model", bound=BaseModel)
CONFIG = Path(__file__).resolve().parents[3] / "config"
"""The configuration of the checkout, whatever the working directory: the one that the Snakefile reads too."""
SHIPPED = Path(__file__).resolve().parents[1] / "config"
"""The same in an installed package, which has no checkout around it; in the checkout a link."""


def load(files: Iterable[Path | str] = (), overrides: Iterable[str] = (), scale: str | None = None) -> Settings:
    """Settings from ``config/config.yaml``, the overlay of ``scale``, further ``files``, then ``key=value`` overrides.

    Later ones win; mappings merge and lists are replaced, as with ``snakemake --configfile``. Without a
    ``config.yaml`` in the checkout (an installed package) the one that the package brings stands in for it.
    """
    folder = CONFIG if (CONFIG / "config.yaml").is_file() else SHIPPED
    named = [folder / "config.yaml"] if scale in (None, "desk") else [folder / "config.yaml", folder / f"{scale}.yaml"]
    sources = [(str(path), read_yaml(path)) for path in [*named, *files]]
    return configured(*overridden(sources, overrides))


def overridden(sources: Sources, overrides: Iterable[str]) -> tuple[dict[str, Any], Sources]:
    """All ``sources`` merged with the assignments of ``--set`` on top, and the sources with these among them."""
    sources = [*sources, ("--set", override({}, overrides))]
    return reduce(merge, (data for _, data in sources), {}), sources


def configured(data: Mapping[str, Any], sources: Sources = ()) -> Settings:
    """``data`` as the whole configuration, whose ``scale`` is true: see `check_scale`."""
    settings = validate(Settings, data, sources)
    check_scale(settings)
    return settings


def read_yaml(path: Path | str) -> dict[str, Any]:
    """A YAML (or JSON) file that holds a mapping; an empty file is an empty one."""
    try:
        data = parse(read_given(path))
    except StrictError as error:
        raise UserError(f"{path}: {error}") from error
    if data is not None and not isinstance(data, dict):
        raise UserError(f"{path}: must be a mapping of keys to values, is {type(data).__name__}")
    return data or {}


def merge(base: Mapping[str, Any], overlay: Mapping[str, Any]) -> dict[str, Any]:
    """``base`` with ``overlay`` on top: mappings merge, everything else is replaced."""
    merged = dict(base)
    for name, value in overlay.items():
        old = merged.get(name)
        merged[name] = merge(old, value) if isinstance(old, Mapping) and isinstance(value, Mapping) else value
    return merged


def override(data: Mapping[str, Any], assignments: Iterable[str]) -> dict[str, Any]:
    """``data`` with assignments such as ``sac.minibatch=64`` on top; values are read as YAML, no key stands twice."""
    merged, assigned = dict(data), set[str]()
    for assignment in assignments:
        name, equals, text = assignment.partition("=")
        if not equals or not name.strip():
            raise UserError(f"--set {assignment}: must be key=value, for example sac.minibatch=64")
        try:
            value = parse(text)
        except StrictError as error:
            raise UserError(f"--set {name.strip()}: {error}") from error
        for part in reversed(name.strip().split(".")):
            value = {part: value}
        for key in _keys(value):
            if any(key == other or f"{key}.".startswith(f"{other}.") for other in assigned):
                raise UserError(f"--set {key}: given twice; keep one")
        assigned.update(_keys(value))
        merged = merge(merged, value)
    return merged


def _keys(data: Any, name: str = "") -> Iterator[str]:
    """The dotted names of all values in nested mappings."""
    if not isinstance(data, Mapping):
        yield name
        return
    for part, value in data.items():
        yield from _keys(value, f"{name}.{part}" if name else str(part))


def validate(model: type[Model], data: Mapping[str, Any], sources: Sources = ()) -> Model:
    """``data``, merged from ``sources``, as settings of ``model``.

    Raises:
        UserError: one line with where the key was written, its value and what is allowed.
    """
    try:
        validated = model.model_validate(dict(data))
    except ValidationError as error:
        raise UserError(_one_line(model, data, error, sources)) from error
    _reject_booleans(data, validated.model_dump(), "", sources)
    return validated


def _one_line(model: type[BaseModel], data: Mapping[str, Any], error: ValidationError, sources: Sources) -> str:
    """The first wrong key, all that is said about it, and how many others are wrong."""
    said: dict[str, list[str]] = {}
    values: dict[str, Any] = {}
    for item in error.errors(include_url=False):
        if item["type"] == "too_short" and item["input"]:
            continue  # pydantic's echo of a wrong entry
        path = _real_path(item["loc"], data)
        name = ".".join(path)
        said.setdefault(name, []).append(_message(model, path, item))
        values.setdefault(name, item["input"])
    first = next(iter(said))
    shown = "" if isinstance(values[first], Mapping) else f" = {values[first]!r}"
    others = f" (and {len(said) - 1} more wrong: {', '.join(list(said)[1:])})" if len(said) > 1 else ""
    return f"{holder(first, sources)}: {first or 'settings'}{shown}: {' or '.join(dict.fromkeys(said[first]))}{others}"


def _real_path(location: tuple[int | str, ...], data: Any) -> tuple[str, ...]:
    """The part of a pydantic location that is in ``data``: without the tags of unions and validators."""
    path: list[str] = []
    for part in location:
        known = range(len(data)) if isinstance(data, list | tuple) else data if isinstance(data, Mapping) else ()
        if part not in known:
            break
        data = data[part]
        path.append(str(part))
    return tuple(path)


def _message(model: type[BaseModel], path: tuple[str, ...], item: Any) -> str:
    if item["type"] == "extra_forbidden":
        return _unknown_key(model, path)
    if item["type"] == "too_short":
        return "must not be empty"
    if item["type"] == "tuple_type":
        return "must be a list"
    if item["type"] in ("model_type", "dict_type"):
        return "must be a mapping of keys to values"
    message: str = item["msg"]
    return message.removeprefix("Value error, ").replace("Input should be", "must be")


def _unknown_key(model: type[BaseModel], path: tuple[str, ...]) -> str:
    for part in path[:-1]:
        inner = model.model_fields[part].annotation
        if isinstance(inner, type) and issubclass(inner, BaseModel):
            model = inner
    close = difflib.get_close_matches(path[-1], model.model_fields, n=1)
    hint = f", did you mean {close[0]}?" if close else ""
    return f"unknown key{hint}; allowed: {', '.join(model.model_fields)}"


def _reject_booleans(raw: Any, validated: Any, name: str, sources: Sources) -> None:
    """YAML's yes and no would pass for the numbers 1 and 0."""
    if isinstance(raw, Mapping) and isinstance(validated, Mapping):
        for part, value in raw.items():
            _reject_booleans(value, validated.get(part), f"{name}.{part}".lstrip("."), sources)
    elif isinstance(raw, list | tuple) and isinstance(validated, list | tuple):
        for index, (old, new) in enumerate(zip(raw, validated, strict=False)):
            _reject_booleans(old, new, f"{name}.{index}", sources)
    elif isinstance(raw, bool) and not isinstance(validated, bool):
        where = holder(name, sources)
        raise UserError(f"{where}: {name} = {raw}: must be a {type(validated).__name__}, not a truth value")
