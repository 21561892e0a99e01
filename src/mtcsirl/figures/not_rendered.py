"""In place of a figure that this machine cannot render: a picture of the words that say so, and how to get it."""

import textwrap

from matplotlib.figure import Figure

from mtcsirl.figures.style import INK, NOTE_COLOUR, TEXT_WIDTH, new_figure, styled


@styled
def words(title: str, why: str, command: str) -> Figure:
    """The figure's title, why it is not rendered here, and the command that draws it afterwards."""
    lines = [
        *textwrap.wrap(f"Not rendered: {why}.", 88),
        "",
        f"Then {command} draws it; a configuration is given as before.",
    ]
    figure = new_figure(TEXT_WIDTH, 0.75 + 0.16 * len(lines))
    figure.set_layout_engine("none")
    height = figure.get_figheight()
    figure.text(0.04, 1 - 0.3 / height, title, fontsize=9, fontweight="bold", color=INK)
    figure.text(0.04, 1 - 0.5 / height, "\n".join(lines), fontsize=7.5, color=NOTE_COLOUR, va="top", linespacing=1.4)
    return figure


def caption(why: str) -> str:
    """What stands under the words."""
    return f"Not rendered on this machine: {why}."
