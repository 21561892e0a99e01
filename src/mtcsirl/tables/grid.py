"""Printed rows and columns: what Markdown, LaTeX and the report show of a table."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from itertools import groupby
from typing import Any


@dataclass(frozen=True)
class Column:
    """One column: ``group`` is the heading it shares with its neighbours ("" for none)."""

    title: str
    group: str = ""


@dataclass(frozen=True)
class Line:
    """One printed line: a label and a text per column.

    ``rule`` draws a rule above it, the columns ``strong`` are bold. A ``section`` has no texts: its label heads the
    lines below it. ``folders``: column -> the runs that its number was made from.
    """

    label: str
    texts: tuple[str, ...] = ()
    rule: bool = False
    strong: tuple[int, ...] = ()
    section: bool = False
    folders: Mapping[int, tuple[str, ...]] = field(default_factory=dict)


@dataclass(frozen=True)
class Grid:
    """Columns and lines; ``corner`` is the heading of the labels."""

    corner: str
    columns: tuple[Column, ...]
    lines: tuple[Line, ...]

    @property
    def groups(self) -> list[tuple[str, int]]:
        """Headings above the columns with the number of columns that each spans; none if no column has a group."""
        if not any(column.group for column in self.columns):
            return []
        return [(group, len(list(run))) for group, run in groupby(self.columns, key=lambda column: column.group)]

    @property
    def titles(self) -> list[str]:
        """One heading per column for forms that know one row of headings: the group stands on its first column."""
        found, previous = [], ""
        for column in self.columns:
            new = column.group and column.group != previous
            found.append(f"{column.group}, {column.title}" if new else column.title)
            previous = column.group
        return found

    @property
    def sections(self) -> Iterator[tuple[Line | None, list[Line]]]:
        """The lines below each section's heading; None heads those that come before any."""
        head, body = None, list[Line]()
        for line in self.lines:
            if line.section:
                if body:
                    yield head, body
                head, body = line, []
            else:
                body.append(line)
        if body:
            yield head, body

    def as_json(self) -> dict[str, Any]:
        """Plain data; defaults are left out."""
        lines = [
            {"label": line.label, "texts": list(line.texts), "rule": line.rule, "strong": list(line.strong),
             "section": line.section, "folders": {str(column): list(own) for column, own in line.folders.items()}}
            for line in self.lines
        ]  # fmt: skip
        columns = [{"title": column.title, "group": column.group} for column in self.columns]
        return {"corner": self.corner, "columns": columns, "lines": lines}

    @classmethod
    def from_json(cls, data: Mapping[str, Any]) -> "Grid":
        """The grid that ``as_json`` made; KeyError, TypeError or ValueError for anything else."""
        columns = tuple(Column(str(column["title"]), str(column["group"])) for column in data["columns"])
        lines = tuple(
            Line(
                str(line["label"]),
                tuple(map(str, line["texts"])),
                bool(line["rule"]),
                tuple(map(int, line["strong"])),
                bool(line["section"]),
                {int(column): tuple(map(str, own)) for column, own in line["folders"].items()},
            )
            for line in data["lines"]
        )
        if any(len(line.texts) != len(columns) for line in lines if not line.section):
            raise ValueError("a line has not as many texts as there are columns")
        return cls(str(data["corner"]), columns, lines)
