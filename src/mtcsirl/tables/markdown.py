"""A grid as a table in Markdown."""

from mtcsirl.tables.grid import Grid, Line


def grid_markdown(grid: Grid) -> str:
    """One row of headings, then the lines; a section is a bold label alone in its row."""
    rows = [[grid.corner, *grid.titles], [":--", *("--:" for _ in grid.columns)]]
    rows += [_row(line, len(grid.columns)) for line in grid.lines]
    return "\n".join("| " + " | ".join(escape(text) for text in row) + " |" for row in rows)


def escape(text: str) -> str:
    """Text that cannot end a cell."""
    return text.replace("|", "\\|")


def _row(line: Line, width: int) -> list[str]:
    if line.section:
        return [f"**{line.label}**", *("" for _ in range(width))]
    return [line.label, *(f"**{text}**" if i in line.strong else text for i, text in enumerate(line.texts))]
