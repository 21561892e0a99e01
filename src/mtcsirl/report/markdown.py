"""Reads a table back from the Markdown that :mod:`mtcsirl.tables` writes."""

import re
from pathlib import Path
from typing import NamedTuple

from mtcsirl.errors import UserError


class MarkdownTable(NamedTuple):
    """Caption, heading, rows (label first) and notes."""

    caption: str
    head: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    notes: tuple[str, ...]


def parse_table(text: str, path: Path | str = "table") -> MarkdownTable:
    """The one table in ``text``: caption above, a line ``- ...`` per note below; ``\\|`` is a bar inside a cell.

    Raises UserError when there is no table or its rows differ in length.
    """
    lines = text.splitlines()
    rows = [_cells(line) for line in lines if line.startswith("|")]
    if len(rows) < 2 or len({len(row) for row in rows}) != 1:
        raise UserError(f"{path}: not a table in Markdown; delete it and make it again")
    before = next(index for index, line in enumerate(lines) if line.startswith("|"))
    caption = " ".join(line.strip() for line in lines[:before] if line.strip())
    return MarkdownTable(
        caption=re.sub(r"^\*\*[^*]*\*\*\s*", "", caption),
        head=rows[0],
        rows=tuple(rows[2:]),
        notes=tuple(line[2:].replace("\\|", "|").strip() for line in lines if line.startswith("- ")),
    )


def _cells(line: str) -> tuple[str, ...]:
    return tuple(cell.replace("\\|", "|").strip() for cell in re.split(r"(?<!\\)\|", line)[1:-1])
