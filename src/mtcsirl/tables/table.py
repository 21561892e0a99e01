"""The layout that all tables share, and its three forms: CSV, Markdown, LaTeX with booktabs."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import pandas as pd

from mtcsirl.settings import Settings
from mtcsirl.settings.template import deviations
from mtcsirl.tables.cells import DASH, LINES, MARK_TEXTS, Cell

SMOKE_NOTE = "smoke scale: numbers mean nothing"
DIFFERS = "Differs from the paper: "
LATEX = {
    "\\": r"\textbackslash{}",
    "&": r"\&",
    "%": r"\%",
    "$": r"\$",
    "#": r"\#",
    "_": r"\_",
    "{": r"\{",
    "}": r"\}",
    "~": r"\textasciitilde{}",
    "^": r"\textasciicircum{}",
    "<": r"$<$",
    ">": r"$>$",
    "|": r"$|$",
    "±": r"$\pm$",
    "†": r"$^{\dagger}$",
    "‡": r"$^{\ddagger}$",
    "§": r"$^{\S}$",
    "–": "--",
    "×": r"$\times$",
}


@dataclass(frozen=True)
class Column:
    """One column: ``group`` is the heading it shares with its neighbours ("" for none)."""

    title: str
    group: str = ""

    @property
    def full_title(self) -> str:
        """Both headings in one line."""
        return f"{self.group}: {self.title}" if self.group else self.title


@dataclass(frozen=True)
class Line:
    """One printed line: a label and a text per column; ``rule`` draws a rule above it, ``strong`` prints it bold."""

    label: str
    texts: tuple[str, ...]
    rule: bool = False
    strong: tuple[int, ...] = ()


@dataclass(frozen=True)
class Table:
    """A table: printed lines for people, ``numbers`` (one row per cell) for programs, notes under both."""

    name: str
    caption: str
    corner: str
    columns: tuple[Column, ...]
    lines: tuple[Line, ...]
    numbers: pd.DataFrame
    notes: tuple[str, ...] = ()
    differences: tuple[str, ...] = ()
    """The last notes in few words, for a page of paper: a study has more of them than fit below a table."""

    @property
    def title(self) -> str:
        """As in "Table 2"."""
        return self.name.replace("_", " ").capitalize()

    def csv(self) -> pd.DataFrame:
        """One row per cell with every number; the notes' scale is a column, so that the file cannot lose it."""
        return self.numbers

    def markdown(self) -> str:
        """The table with its caption above and its notes below."""
        head = [self.corner, *(column.full_title for column in self.columns)]
        body = [head, [":--", *("--:" for _ in self.columns)]]
        for line in self.lines:
            texts = [f"**{text}**" if i in line.strong else text for i, text in enumerate(line.texts)]
            body.append([line.label, *texts])
        table = "\n".join("| " + " | ".join(_markdown(text) for text in row) + " |" for row in body)
        notes = "\n".join(f"- {_markdown(note)}" for note in self.notes)
        return f"**{self.title}.** {self.caption}\n\n{table}\n\n{notes}\n"

    def latex(self) -> str:
        """A ``table`` environment; needs the packages booktabs and graphicx."""
        body = []
        for line in self.lines:
            texts = [rf"\textbf{{{_latex(t)}}}" if i in line.strong else _latex(t) for i, t in enumerate(line.texts)]
            body.append("\\midrule\n" * line.rule + " & ".join([_latex(line.label), *texts]) + r" \\")
        head = " & ".join(_latex(text) for text in [self.corner, *(column.title for column in self.columns)])
        label = self.name.replace("_", ":")
        notes = [_latex(note) + r"\par" for note in self.notes if not note.startswith(DIFFERS)]
        if self.differences:
            text = f"Settings that differ from the paper's, which stand in parentheses: {'; '.join(self.differences)}"
            notes.append(r"\tiny " + _latex(text) + r"\par")
        return "\n".join(
            [
                r"\begin{table}[htbp]",
                r"\centering\footnotesize",
                rf"\caption{{{_latex(self.caption)}}}\label{{{label}}}",
                r"\resizebox{\ifdim\width>\textwidth\textwidth\else\width\fi}{!}{%",
                rf"\begin{{tabular}}{{l{'r' * len(self.columns)}}}",
                r"\toprule",
                *self._latex_groups(),
                head + r" \\",
                r"\midrule",
                *body,
                r"\bottomrule",
                r"\end{tabular}}",
                r"\par\medskip\raggedright\scriptsize",
                *notes,
                r"\end{table}",
                "",
            ]
        )

    def _latex_groups(self) -> list[str]:
        """Group headings with a rule under each."""
        if not any(column.group for column in self.columns):
            return []
        names, rules, start = [], [], 2
        for group, width in _runs(column.group for column in self.columns):
            names.append(rf"\multicolumn{{{width}}}{{c}}{{{_latex(group)}}}")
            rules.append(rf"\cmidrule(lr){{{start}-{start + width - 1}}}" if group else "")
            start += width
        return [" & ".join(["", *names]) + r" \\", "".join(rules)]


@dataclass(frozen=True)
class Entry:
    """A cell in a column: how it is printed and what it is called in the CSV."""

    cell: Cell
    metric: str
    digits: int = 2
    factor: float = 1.0
    strong: bool = False

    def lines(self) -> tuple[str, ...]:
        """The texts of ``LINES``."""
        return self.cell.lines(self.digits, self.factor)


def entry_lines(label: str, entries: Sequence[Entry], rule: bool = True) -> list[Line]:
    """The lines of one row of cells: ours, the t-interval, the paper's and, where it predicts any, the prediction."""
    first, *further = zip(*(entry.lines() for entry in entries), strict=True)
    strong = tuple(i for i, entry in enumerate(entries) if entry.strong)
    if set(further[-1]) == {DASH}:
        further.pop()
    lines = [Line(name, tuple(text)) for name, text in zip(LINES[1:], further, strict=False)]
    return [Line(label, tuple(first), rule, strong), *lines]


def result_table(
    name: str,
    caption: str,
    corner: str,
    columns: Sequence[Column],
    rows: Sequence[tuple[str, Sequence[Entry]]],
    settings: Settings,
    remarks: Sequence[str] = (),
) -> Table:
    """A table of cells: lines per row, one CSV row per cell, marks explained, scale and deviations below."""
    lines = [line for i, (label, entries) in enumerate(rows) for line in entry_lines(label, entries, rule=i > 0)]
    numbers: list[dict[str, Any]] = [
        {"row": label, "column": column.full_title, "metric": entry.metric, **entry.cell.numbers()}
        for label, entries in rows
        for column, entry in zip(columns, entries, strict=True)
    ]
    cells = [entry.cell for _, entries in rows for entry in entries]
    used = {kind for cell in cells for kind in cell.marks}
    marks = [text for kind, text in MARK_TEXTS.items() if kind in used]
    frame = pd.DataFrame(numbers).assign(scale=settings.scale)
    lacking = sum(cell.ours.n < cell.expected for cell in cells)
    gaps = [f"incomplete: {lacking} of {len(cells)} cells lack seeds"] if lacking else []
    notes = (*scale_notes(settings), *gaps, *remarks, *marks, *deviation_notes(settings))
    return Table(name, caption, corner, tuple(columns), tuple(lines), frame, notes, differences(settings))


def scale_notes(settings: Settings) -> list[str]:
    """What every artefact says first: the scale, and that smoke numbers mean nothing."""
    if settings.scale == "smoke":
        return [SMOKE_NOTE]
    return [f"scale {settings.scale}; {len(settings.seeds)} seeds ({', '.join(map(str, settings.seeds))})"]


def deviation_notes(settings: Settings) -> list[str]:
    """Every setting that differs from the paper's, one line each."""
    found = [str(deviation) for deviation in deviations(settings)]
    return [DIFFERS + text for text in found] or ["All settings that the paper gives are the paper's"]


def differences(settings: Settings) -> tuple[str, ...]:
    """The same without what the setting is, as in "sac.discount = 0.9 (0.99)"."""
    found = deviations(settings)
    return tuple(str(one).removesuffix(f": {one.text}").replace("(paper: ", "(") for one in found)


def _runs(items: Iterable[str]) -> list[tuple[str, int]]:
    """Equal neighbours as (item, count)."""
    runs: list[tuple[str, int]] = []
    for item in items:
        if runs and runs[-1][0] == item:
            runs[-1] = (item, runs[-1][1] + 1)
        else:
            runs.append((item, 1))
    return runs


def _markdown(text: str) -> str:
    return text.replace("|", "\\|")


def _latex(text: str) -> str:
    return "".join(LATEX.get(character, character) for character in text)
