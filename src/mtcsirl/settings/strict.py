"""YAML and JSON read so that nothing in them is lost or misread without a word.

YAML 1.1 takes the last of two equal keys, reads ``0100`` as 64 and ``64:30`` as 3870, and a kilobyte of aliases can
stand for a gigabyte. All of these are refused here, with the line they stand in.
"""

import json
import re
from typing import Any

import yaml

LONGEST, DEEPEST, MOST = 1 << 20, 20, 20_000
"""Characters of a text, nesting of its mappings and lists, and values in it with every alias written out."""
MERGE = "tag:yaml.org,2002:merge"
OCTAL = re.compile(r"[-+]?0[0-7_]+$")
SEXAGESIMAL = re.compile(r"[-+]?\d[\d_]*(:[0-5]?\d)+(\.\d*)?$")


class StrictError(ValueError):
    """What is wrong with the text and where, in one line without its file's name."""


def parse(text: str) -> Any:
    """The value of a YAML or JSON ``text``; raises StrictError."""
    if len(text) > LONGEST:
        raise StrictError(f"{len(text):,} characters, at most {LONGEST:,} are read")
    if text.lstrip().startswith("{"):
        try:
            return parse_json(text)
        except NotJsonError:
            pass  # YAML has mappings in braces too
    try:
        return yaml.load(text.removeprefix("\ufeff"), _Loader)
    except yaml.YAMLError as error:
        raise StrictError(f"not valid YAML: {' '.join(str(error).split())}") from error
    except StrictError:
        raise
    except ValueError as error:  # a date that is none, a number of more than 4300 digits
        raise StrictError(f"not valid YAML: {str(error).partition(';')[0]}") from error


class NotJsonError(StrictError):
    """The text is no JSON at all."""


def parse_json(text: str) -> Any:
    """The value of a JSON ``text``; raises StrictError, or NotJsonError where the text is none."""
    if len(text) > LONGEST:
        raise StrictError(f"{len(text):,} characters, at most {LONGEST:,} are read")
    try:
        data = json.loads(text, object_pairs_hook=_mapping, parse_constant=_constant)
    except json.JSONDecodeError as error:
        raise NotJsonError(f"not valid JSON: {error}") from error
    except RecursionError as error:
        raise StrictError(f"nested more than {DEEPEST} deep") from error
    except StrictError:
        raise
    except ValueError as error:  # Python reads no number of more than 4300 digits
        raise StrictError(str(error).partition(";")[0]) from error
    _depth(data, 1)
    return data


def _mapping(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    names = [name for name, _ in pairs]
    twice = [name for name in names if names.count(name) > 1]
    if twice:
        raise StrictError(f"the key {twice[0]!r} stands twice in one mapping; keep one")
    return dict(pairs)


def _constant(name: str) -> float:
    return float(name)  # NaN and Infinity: the settings refuse them by their key


def _depth(data: Any, depth: int) -> None:
    if depth > DEEPEST:
        raise StrictError(f"nested more than {DEEPEST} deep")
    for item in data.values() if isinstance(data, dict) else data if isinstance(data, list) else ():
        _depth(item, depth + 1)


class _Loader(yaml.SafeLoader):
    """PyYAML's safe loader with the limits of this module."""

    def __init__(self, text: str) -> None:
        super().__init__(text)
        self._depth = 0
        self._sizes: dict[int, int] = {}

    def compose_node(self, parent: yaml.Node | None, index: int) -> yaml.Node | None:
        """One node; refuses it when it lies too deep or, aliases written out, stands for too many values."""
        self._depth += 1
        if self._depth > DEEPEST:
            raise StrictError(f"nested more than {DEEPEST} deep{_place(self.peek_event())}")  # type: ignore[no-untyped-call]
        alias = self.check_event(yaml.AliasEvent)
        node: yaml.Node | None = super().compose_node(parent, index)
        self._depth -= 1
        if alias:
            return node
        if isinstance(node, yaml.MappingNode):
            _check_keys(node)
            parts: list[yaml.Node] = [part for pair in node.value for part in pair]
        else:
            parts = list(node.value) if isinstance(node, yaml.SequenceNode) else []
        size = 1 + sum(self._sizes.get(id(part), MOST) for part in parts)  # a node within itself has no size yet
        if size > MOST:
            raise StrictError(f"more than {MOST:,} values once its aliases are written out{_place(node)}")
        self._sizes[id(node)] = size
        return node

    def number(self, node: yaml.ScalarNode) -> int | float:
        """A number that YAML 1.1 and its reader take for the same one."""
        text = str(node.value)
        if OCTAL.match(text) or SEXAGESIMAL.match(text):
            kind = "in base 8" if OCTAL.match(text) else "in base 60"
            raise StrictError(
                f"{text}{_place(node)} is a number {kind} to YAML; write it without leading zeros or colons"
            )
        is_float = node.tag.endswith("float")
        value: int | float = self.construct_yaml_float(node) if is_float else self.construct_yaml_int(node)
        return value


for _kind in ("int", "float"):
    _Loader.add_constructor(f"tag:yaml.org,2002:{_kind}", _Loader.number)


def _check_keys(mapping: yaml.MappingNode) -> None:
    """Raise StrictError where a key stands twice; before merges (``<<``) are resolved, which would hide it."""
    seen: set[str] = set()
    for name, _ in mapping.value:
        if isinstance(name, yaml.ScalarNode):
            if name.value in seen:
                way_out = "merge a list, <<: [*one, *two]" if name.tag == MERGE else "keep one"
                raise StrictError(f"the key {name.value!r} stands twice in one mapping{_place(name)}; {way_out}")
            seen.add(name.value)


def _place(where: Any) -> str:
    mark = getattr(where, "start_mark", None)
    return "" if mark is None else f" (line {mark.line + 1})"
