"""The figures, numbered as in the paper: each a pure function of data that returns a matplotlib Figure."""

from collections.abc import Callable
from dataclasses import dataclass
from importlib import import_module

from matplotlib.figure import Figure

from mtcsirl.errors import UserError
from mtcsirl.figures.data import FigureData
from mtcsirl.study.artefacts import RENDERED


@dataclass(frozen=True)
class FigureSpec:
    """One figure: its title, how it is drawn and what its caption says.

    ``rendered`` figures show MuJoCo scenes and need Debian's ``libosmesa6`` on a machine without a screen;
    without it :mod:`mtcsirl.figures.not_rendered` stands in their place.
    """

    name: str
    title: str
    draw: Callable[[FigureData], Figure]
    caption: Callable[[FigureData], str]
    rendered: bool


FIGURES = (*(f"figure_{number}" for number in range(1, 10)), "figure_s1", "figure_s2")
"""Names of all figures; ``s1`` and ``s2`` are the single-task figures that the paper does not draw."""


def figure_spec(name: str) -> FigureSpec:
    """The figure called ``name``; UserError if there is none."""
    if name not in FIGURES:
        raise UserError(f"unknown figure {name!r}; allowed: {', '.join(FIGURES)}")
    module = import_module(f"mtcsirl.figures.{name}")
    return FigureSpec(name, module.TITLE, module.draw, module.caption, name in RENDERED)
