"""Tables, figures and verdicts as the page shows them, each from its own files."""

import os
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from mtcsirl.errors import UserError
from mtcsirl.figures import figure_spec
from mtcsirl.figures.style import caption_of
from mtcsirl.files import storage
from mtcsirl.files.identity import FILE, Record
from mtcsirl.report.content import Claim, FigureView, TableView
from mtcsirl.report.pages_there import file_of, is_signed
from mtcsirl.report.verdicts import claims_of
from mtcsirl.settings import Settings
from mtcsirl.study.artefacts import record_folder
from mtcsirl.study.design import CLAIMS
from mtcsirl.study.partial import NOTE
from mtcsirl.tables.table import Table

TABLE_TITLES = {
    "table_1": "Action norm: learned on several targets, tried on new targets and other tasks",
    "table_2": "Unseen tasks: all methods",
    "table_3": "Velocity: learned on several targets, tried on new targets and other tasks",
    "table_4": "MT-CSIRL+LT: both rewards learned, agents from scratch",
    "table_5": "Hyperparameters of SAC",
}
TABLE_FILES = (("its rows (CSV)", "csv"), ("Markdown", "md"), ("LaTeX", "tex"), ("JSON", "json"))


@dataclass(frozen=True)
class Judged:
    """The verdicts; empty where there are none."""

    claims: tuple[Claim, ...] = ()
    beforehand: str = ""
    links: tuple[tuple[str, str], ...] = ()
    picture: FigureView | None = None


def title_of(name: str) -> str:
    """The title of a table or figure."""
    return figure_spec(name).title if name.startswith("figure_") else TABLE_TITLES[name]


@dataclass(frozen=True)
class Views:
    """What the page that will lie at ``page`` shows of an artefact, by its name and record.

    Every view raises UserError where a file is not what the suite writes.
    """

    settings: Settings
    page: Path

    def table(self, name: str, record: Record) -> TableView:
        """A table, with its heat map where it has one."""
        path = file_of(name, self.settings)
        table = Table.from_json(storage.read_json(path), path)
        links = self.links((text, path.with_suffix(f".{ending}")) for text, ending in TABLE_FILES)
        picture = self._beside(name, f"{table.title} as a heat map", record)
        return TableView(name, title_of(name), table, links, picture)

    def figure(self, name: str, record: Record) -> FigureView:
        """A figure."""
        path = file_of(name, self.settings)
        folder = record_folder(name, self.settings.results)
        records = [("its runs (JSON)", folder / file) for file in (FILE, NOTE)]
        links = self.links((("PDF", path.with_suffix(".pdf")), ("PNG", path), *records))
        return FigureView(name, title_of(name), *_picture(path), links)

    def verdicts(self, name: str, record: Record) -> Judged:
        """The claims, with the picture of all."""
        path = file_of(name, self.settings)
        judged: Any = storage.read_json(path)
        claims = claims_of(judged, path)
        links = self.links((("every number (JSON)", path), ("Markdown", path.with_suffix(".md"))))
        return Judged(claims, str(judged.get("beforehand", "")), links, self._beside(CLAIMS, "All verdicts", record))

    def links(self, files: Iterable[tuple[str, Path]]) -> tuple[tuple[str, str], ...]:
        """Addresses relative to the page of those files that are there."""
        start = self.page.parent
        return tuple((text, Path(os.path.relpath(file, start)).as_posix()) for text, file in files if file.is_file())

    def _beside(self, name: str, title: str, record: Record) -> FigureView | None:
        """The picture that some artefacts have beside their first file."""
        path = file_of(name, self.settings).with_suffix(".png")
        if not is_signed(path, name, self.settings, record):
            return None
        return FigureView(f"{name}_picture", title, *_picture(path))


def _picture(path: Path) -> tuple[str, bytes]:
    """The caption of a PNG file, and its bytes."""
    png = storage.read_bytes(path)
    try:
        return caption_of(png), png
    except (OSError, ValueError, SyntaxError) as error:
        raise UserError(f"{path}: not a readable picture; delete it and make it again") from error
