"""A table of the paper and its forms: CSV (every number), Markdown, LaTeX with booktabs, and JSON for the report."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pandas as pd

from mtcsirl.errors import UserError
from mtcsirl.results.notes import KINDS, Note, of_kind
from mtcsirl.tables.grid import Column, Grid, Line
from mtcsirl.tables.latex import grid_latex, latex
from mtcsirl.tables.markdown import escape, grid_markdown

INTERVALS = "Intervals behind it (95 %): of our mean (Student's t over seeds), and where the paper predicts it"

DIFFERS = "Settings that differ from the paper's"


@dataclass(frozen=True)
class Table:
    """A table: a ``grid`` for people, ``numbers`` (one row per cell) for programs, notes under both.

    ``intervals``: a second grid with the same labels, the intervals behind the numbers of the first.
    """

    name: str
    caption: str
    grid: Grid
    notes: tuple[Note, ...] = ()
    intervals: Grid | None = None
    numbers: pd.DataFrame = field(default_factory=pd.DataFrame)

    @property
    def title(self) -> str:
        """As in "Table 2"."""
        return self.name.replace("_", " ").capitalize()

    @property
    def columns(self) -> tuple[Column, ...]:
        """The columns of the grid."""
        return self.grid.columns

    @property
    def lines(self) -> tuple[Line, ...]:
        """The lines of the grid."""
        return self.grid.lines

    @property
    def is_empty(self) -> bool:
        """Whether the study has no line of it, or no run has reached any of its cells."""
        return not self.lines or ("n" in self.numbers and not self.numbers["n"].any())

    def csv(self) -> pd.DataFrame:
        """One row per cell with every number; the scale is a column, so that the file cannot lose it."""
        return self.numbers

    def markdown(self) -> str:
        """The table with its caption above; below it notes, intervals, and what differs from the paper."""
        own, differences = of_kind(self.notes, "scale", "gap", "mark", "remark"), of_kind(self.notes, "deviation")
        parts = [f"**{self.title}.** {self.caption}", self._body(), *_items(own)]
        if self.intervals is not None:
            parts += [f"{INTERVALS}:", grid_markdown(self.intervals)]
        if differences:
            parts += [f"{DIFFERS}:", *_items(differences)]
        return "\n\n".join(parts) + "\n"

    def brief(self) -> str:
        """The table with its caption and those notes that are its own: not the study's scale and deviations."""
        notes = of_kind(self.notes, "gap", "mark", "remark")
        return "\n\n".join([self.caption, self._body(), *_items(notes)])

    def latex(self) -> str:
        """A ``table`` environment; needs the packages booktabs and graphicx. Deviations stand in few words."""
        notes = [latex(note.text) + r"\par" for note in of_kind(self.notes, "scale", "gap", "mark", "remark")]
        short = [note.short or note.text for note in of_kind(self.notes, "deviation")]
        if short:
            text = f"{DIFFERS}, which stand in parentheses: {'; '.join(short)}"
            notes.append(r"\tiny " + latex(text) + r"\par")
        body = [r"\resizebox{\ifdim\width>\textwidth\textwidth\else\width\fi}{!}{%", *grid_latex(self.grid)]
        return "\n".join(
            [
                r"\begin{table}[htbp]",
                r"\centering\footnotesize",
                rf"\caption{{{latex(self.caption)}}}\label{{{self.name.replace('_', ':')}}}",
                *([*body[:-1], body[-1] + "}"] if self.lines else [rf"\emph{{{latex(self._why_empty())}}}"]),
                r"\par\medskip\raggedright\scriptsize",
                *notes,
                r"\end{table}",
                "",
            ]
        )

    def as_json(self) -> dict[str, Any]:
        """What people read, as data: caption, columns, lines, intervals, notes with their kinds."""
        notes = [{"kind": note.kind, "text": note.text, "short": note.short} for note in self.notes]
        intervals = None if self.intervals is None else self.intervals.as_json()
        own = {"name": self.name, "caption": self.caption}
        return own | self.grid.as_json() | {"intervals": intervals, "notes": notes}

    @classmethod
    def from_json(cls, data: Any, path: Path | str = "table") -> "Table":
        """The table that ``as_json`` made, without its numbers.

        Raises:
            UserError: it is something else.
        """
        try:
            intervals = None if data["intervals"] is None else Grid.from_json(data["intervals"])
            notes = tuple(_note(note) for note in data["notes"])
            return cls(str(data["name"]), str(data["caption"]), Grid.from_json(data), notes, intervals)
        except (KeyError, TypeError, ValueError) as error:
            raise UserError(f"{path}: not a table of this suite ({error}); delete it and make it again") from error

    def _body(self) -> str:
        return grid_markdown(self.grid) if self.lines else f"*{self._why_empty()}*"

    def _why_empty(self) -> str:
        return "; ".join(note.text for note in of_kind(self.notes, "gap")) or "nothing to show"


def _items(notes: tuple[Note, ...]) -> list[str]:
    """One list in Markdown; nothing without notes."""
    return ["\n".join(f"- {escape(note.text)}" for note in notes)] if notes else []


def _note(data: Mapping[str, Any]) -> Note:
    if data["kind"] not in KINDS:
        raise ValueError(f"unknown kind of note {data['kind']!r}")
    return Note(data["kind"], str(data["text"]), str(data["short"]))
