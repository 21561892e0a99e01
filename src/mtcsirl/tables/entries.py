"""How tables of results are laid out: ours and the paper's in neighbouring columns, intervals in a second grid."""

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd

from mtcsirl.results.notes import Note, deviation_notes, study_note
from mtcsirl.settings import Settings
from mtcsirl.tables.cells import MARK_TEXTS, MARKS, SIGN_TEXTS, SIGNS, Cell
from mtcsirl.tables.grid import Column, Grid, Line
from mtcsirl.tables.table import Table


@dataclass(frozen=True)
class Quantity:
    """What two neighbouring columns show, ours and the paper's; not ``published``: one column, ours.

    ``factor`` 100 prints shares as percent. ``same_agents``: as the quantity to its left, where their marks stand.
    ``usual``: the number of seeds that is not printed in every cell, for tables too wide for it.
    """

    title: str
    published: bool = True
    digits: int = 2
    factor: float = 1.0
    same_agents: bool = False
    usual: int = 0


@dataclass(frozen=True)
class Entry:
    """A cell, what its column is called in the CSV, and the metric that it shows."""

    cell: Cell
    column: str
    metric: str
    strong: bool = False


@dataclass(frozen=True)
class Row:
    """A label and one entry per quantity; ``rule`` draws a rule above it."""

    label: str
    entries: tuple[Entry, ...]
    rule: bool = False


Section = tuple[str, Sequence[Row]]
"""Rows under their heading ("" for none)."""


@dataclass(frozen=True)
class Layout:
    """The cells of a table in their place."""

    corner: str
    quantities: tuple[Quantity, ...]
    sections: tuple[Section, ...]

    @property
    def rows(self) -> list[Row]:
        """All rows, without their headings."""
        return [row for _, rows in self.sections for row in rows]

    @property
    def cells(self) -> list[Cell]:
        """All cells."""
        return [entry.cell for row in self.rows for entry in row.entries]

    @property
    def predicted(self) -> list[bool]:
        """Of which quantities the paper predicts any cell; the others' columns carry no sign."""
        cells = [[row.entries[i].cell for row in self.rows] for i in range(len(self.quantities))]
        return [any(not np.isnan(cell.prediction.low) for cell in column) for column in cells]

    def numbers(self) -> pd.DataFrame:
        """One row per cell."""
        rows = [
            {"row": row.label, "column": entry.column, "metric": entry.metric, **entry.cell.numbers()}
            for row in self.rows
            for entry in row.entries
        ]
        return pd.DataFrame(rows)

    def grid(self, results: Path) -> Grid:
        """Ours and the paper's side by side; folders of runs are those below ``results``."""
        columns: list[Column] = []
        for one in self.quantities:
            columns += [Column("ours", one.title), Column("paper", one.title)] if one.published else [Column(one.title)]
        lines = self._lines(self._texts, [i for i, column in enumerate(columns) if column.title != "paper"], results)
        return Grid(self.corner, tuple(columns), tuple(lines))

    def intervals(self) -> Grid | None:
        """The t-interval of each of our means, and where the paper predicts it; None where nothing has an interval."""
        if all(np.isnan(cell.interval.low) for cell in self.cells):
            return None
        columns: list[Column] = []
        for one, predicted in zip(self.quantities, self.predicted, strict=True):
            columns += [Column("ours", one.title), *([Column("paper predicts", one.title)] if predicted else [])]
        return Grid(self.corner, tuple(columns), tuple(self._lines(self._interval_texts)))

    def mark_notes(self) -> Iterator[Note]:
        """What the signs that were used mean."""
        kinds = {kind for cell in self.cells for kind in cell.marks}
        yield from (Note("mark", text) for kind, text in MARK_TEXTS.items() if kind in kinds)
        signs = {
            entry.cell.comparison
            for row in self.rows
            for entry, predicted in zip(row.entries, self.predicted, strict=True)
            if predicted
        }
        yield from (Note("mark", text) for sign, text in SIGN_TEXTS.items() if sign in signs)

    def gap_notes(self) -> Iterator[Note]:
        """How many cells lack seeds."""
        lacking = sum(cell.ours.n < cell.expected for cell in self.cells)
        if lacking:
            yield Note("gap", f"incomplete: {lacking} of {len(self.cells)} cells lack seeds")
        if any(cell.unaveraged for cell in self.cells):
            yield Note("gap", "a seed that lacks one of the tasks is left out, with its agents on the others")

    def _lines(
        self, texts: Callable[[Row], tuple[list[str], list[int]]], ours: Sequence[int] = (), results: Path = Path()
    ) -> Iterator[Line]:
        """``ours``: the columns of our numbers, which know their runs."""
        for number, (heading, rows) in enumerate(self.sections):
            if heading:
                yield Line(heading, rule=number > 0, section=True)
            for row in rows:
                own, strong = texts(row)
                cells = dict(zip(ours, (entry.cell for entry in row.entries), strict=False))
                folders = {i: below(results, cell.folders) for i, cell in cells.items() if cell.folders}
                yield Line(row.label, tuple(own), row.rule, tuple(strong), folders=folders)

    def _texts(self, row: Row) -> tuple[list[str], list[int]]:
        """The texts of a row and which of them are bold."""
        texts: list[str] = []
        strong: list[int] = []
        for entry, one, predicted in zip(row.entries, self.quantities, self.predicted, strict=True):
            cell = entry.cell
            signs = [SIGNS[cell.comparison]] if predicted else []
            signs += [] if one.same_agents else [f"{MARKS[kind]}{count}" for kind, count in cell.marks.items()]
            strong += [len(texts)] if entry.strong else []
            texts.append(" ".join([cell.ours_text(one.digits, one.factor, usual=one.usual), *filter(None, signs)]))
            texts += [cell.paper_text(one.digits, one.factor)] if one.published else []
        return texts, strong

    def _interval_texts(self, row: Row) -> tuple[list[str], list[int]]:
        texts: list[str] = []
        for entry, one, predicted in zip(row.entries, self.quantities, self.predicted, strict=True):
            texts.append(entry.cell.interval_text(one.digits, one.factor))
            texts += [entry.cell.prediction_text(one.factor)] if predicted else []
        return texts, []


def below(results: Path, folders: Iterable[str]) -> tuple[str, ...]:
    """Folders of runs as their keys name them, wherever the results lie."""
    return tuple(Path(folder).relative_to(results).as_posix() for folder in folders)


def result_table(name: str, caption: str, layout: Layout, settings: Settings, notes: Sequence[Note] = ()) -> Table:
    """The table of a layout: signs explained, scale and deviations in its notes."""
    return Table(
        name=name,
        caption=caption,
        grid=layout.grid(Path(settings.results)),
        notes=(
            study_note(settings),
            *layout.gap_notes(),
            *notes,
            *layout.mark_notes(),
            *deviation_notes(settings),
        ),
        intervals=layout.intervals(),
        numbers=layout.numbers().assign(scale=settings.scale),
    )
