"""A Mermaid flow chart as a picture, at build time: Mermaid itself is a script of three megabytes from a network.

Only what docs/ has is understood: ``flowchart LR`` and lines ``a & b --> c[label] --> d``. It is drawn from top to
bottom, which fits a column of text, and without arrows that follow from others.
"""

import html
import re
from itertools import pairwise
from typing import Any

from pymdownx.superfences import SuperFencesException

WIDTH, HEIGHT, GAP, SPACE = 216, 34, 16, 34
"""Of a box, between boxes of a row and between rows; pixels."""
_AND = re.compile(r"&(?![^\[]*\])")
_NODE = re.compile(r"(\w+)(?:\[(.*)\])?")


def fence(source: str, language: str, class_name: str, options: Any, md: Any, **kwargs: Any) -> str:
    """What the Markdown extension superfences calls for a block of Mermaid."""
    try:
        return f'<figure class="{class_name}">{drawing(source)}</figure>'
    except ValueError as error:  # of any other kind superfences would make a block of code
        raise SuperFencesException(str(error)) from error


def drawing(source: str) -> str:
    """The chart as SVG. Raises ValueError for a line that is not understood."""
    labels, arrows = parsed(source)
    row = rows(labels, arrows)
    across: dict[int, list[str]] = {}
    for name in labels:
        across.setdefault(row[name], []).append(name)
    width = max(map(len, across.values())) * (WIDTH + GAP) - GAP + 8
    height = len(across) * (HEIGHT + SPACE) - SPACE + 8
    place = {}
    for number, names in across.items():
        left = (width - len(names) * (WIDTH + GAP) + GAP) / 2
        for column, name in enumerate(names):
            place[name] = (left + column * (WIDTH + GAP), number * (HEIGHT + SPACE) + 4)
    shapes = [_arrow(place[a], place[b]) for a, b in shortest(arrows)]
    shapes += [_box(labels[name], *place[name]) for name in labels]
    told = html.escape("; ".join(f"{labels[a]} leads to {labels[b]}" for a, b in arrows))
    head = '<marker id="tip" viewBox="0 0 8 8" refX="8" refY="4" markerWidth="8" markerHeight="8" orient="auto">'
    return (
        f'<svg viewBox="0 0 {width} {height}" width="{width}" role="img" aria-label="{told}">'
        f'<defs>{head}<path d="M0 0L8 4L0 8z"/></marker></defs>{"".join(shapes)}</svg>'
    )


def parsed(source: str) -> tuple[dict[str, str], list[tuple[str, str]]]:
    """Labels of the nodes in the order in which they come, and arrows between them."""
    first, *lines = [line.strip() for line in source.strip().splitlines()]
    if first != "flowchart LR":
        raise ValueError(f"diagram: {first!r} is not understood")
    labels: dict[str, str] = {}
    arrows: list[tuple[str, str]] = []
    for line in lines:
        groups = [[_node(text, labels, line) for text in _AND.split(part)] for part in line.split("-->")]
        for sources, targets in pairwise(groups):
            arrows += [(a, b) for a in sources for b in targets if (a, b) not in arrows]
    return labels, arrows


def _node(text: str, labels: dict[str, str], line: str) -> str:
    found = _NODE.fullmatch(text.strip())
    if not found:
        raise ValueError(f"diagram: {line!r} is not understood")
    if found[2] or found[1] not in labels:
        labels[found[1]] = found[2] or found[1]
    return found[1]


def rows(labels: dict[str, str], arrows: list[tuple[str, str]]) -> dict[str, int]:
    """The row of each node: one below the last of those that lead to it. Raises ValueError for a circle."""
    row = dict.fromkeys(labels, 0)
    for _ in labels:
        before = dict(row)
        for a, b in arrows:
            row[b] = max(row[b], row[a] + 1)
        if row == before:
            return row
    raise ValueError("diagram: a circle")


def shortest(arrows: list[tuple[str, str]]) -> list[tuple[str, str]]:
    """The arrows whose end is not reached without them."""

    def reaches(a: str, b: str) -> bool:
        return any(d == b or reaches(d, b) for c, d in arrows if c == a)

    return [(a, b) for a, b in arrows if not any(c == a and d != b and reaches(d, b) for c, d in arrows)]


def _box(label: str, left: float, top: float) -> str:
    middle = f'x="{left + WIDTH / 2:g}" y="{top + HEIGHT / 2:g}"'
    return (
        f'<rect x="{left:g}" y="{top:g}" width="{WIDTH}" height="{HEIGHT}" rx="5"/>'
        f'<text {middle} dominant-baseline="central" text-anchor="middle">{html.escape(label)}</text>'
    )


def _arrow(start: tuple[float, float], end: tuple[float, float]) -> str:
    x, y, u, v = start[0] + WIDTH / 2, start[1] + HEIGHT, end[0] + WIDTH / 2, end[1] - 2
    bend = SPACE / 2
    curve = f"M{x:g} {y:g}C{x:g} {y + bend:g} {u:g} {v - bend:g} {u:g} {v:g}"
    return f'<path class="arrow" marker-end="url(#tip)" d="{curve}"/>'
