"""How every verb that draws writes its figure."""

from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def write_figure(path: Path, figure: "Figure", caption: str) -> None:
    """Write ``path`` with the endings .pdf and .png in place of its own."""
    from mtcsirl.figures.style import figure_bytes
    from mtcsirl.files.storage import write_bytes

    write_bytes(path.with_suffix(".pdf"), figure_bytes(figure, "pdf", caption))
    write_bytes(path.with_suffix(".png"), figure_bytes(figure, "png", caption))
