"""The start page as one HTML file: styles, pictures and one short script inside, nothing from a network."""

from base64 import b64encode
from hashlib import sha256
from importlib import resources

from jinja2 import Environment, FunctionLoader, StrictUndefined
from markupsafe import Markup

from mtcsirl.claims.unit_text import COLUMNS
from mtcsirl.report.content import FigureView, ReportData
from mtcsirl.results.notes import Kind, of_kind, scale_notes

VERDICTS = {
    "reproduced": "good",
    "partially": "partly",
    "not reproduced": "bad",
    "inconclusive": "open",
    "precondition not met": "open",
    "not run": "none",
}
"""Verdict and its style; the words stand beside the colour."""
CONFIGS = {"smoke": "--configfile config/smoke.yaml ", "paper": "--configfile config/paper.yaml "}
BESIDE: tuple[Kind, ...] = ("scale", "gap", "mark")
"""Notes that are read with a table; remarks are unfolded, and deviations have a section of their own."""


def build_report(data: ReportData) -> str:
    """The page; equal data gives equal text. Every text is escaped."""
    environment = Environment(
        loader=FunctionLoader(_file), autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True
    )
    environment.filters |= {
        "picture": _picture,
        "number": _number,
        "title": _title,
        "duration": _duration,
    }
    script = _file("page.js")
    return environment.get_template("page.html").render(
        data=data,
        css=Markup(_file("page.css")),
        script=Markup(script),
        script_hash=b64encode(sha256(script.encode()).digest()).decode(),
        verdict_style=VERDICTS,
        verdict_counts=_verdict_counts(data),
        unit_columns=COLUMNS,
        warnings=scale_notes(data.run.scale),
        beside=lambda notes: of_kind(notes, *BESIDE),
        of_kind=of_kind,
        command=f"snakemake --cores 2 {CONFIGS.get(data.run.scale, '')}",
    )


def _file(name: str) -> str:
    return resources.files("mtcsirl.report").joinpath(name).read_text(encoding="utf-8")


def _picture(figure: FigureView) -> str:
    """The PNG as a data address, so that the page can be moved and mailed."""
    return "data:image/png;base64," + b64encode(figure.png).decode("ascii")


def _number(value: float | None, digits: int = 2) -> str:
    return "–" if value is None or value != value else f"{value:.{digits}f}"


def _duration(seconds: float) -> str:
    """As in ``35 s``, ``12 min``, ``3.4 h``."""
    if seconds < 100:
        return f"{seconds:.0f} s"
    return f"{seconds / 60:.0f} min" if seconds < 6000 else f"{seconds / 3600:.1f} h"


def _title(name: str) -> str:
    """As in "Table 2"; supplementary figures are "Figure S1"."""
    kind, _, number = name.partition("_")
    return f"{kind.capitalize()} {number.upper()}" if number else kind.capitalize()


def _verdict_counts(data: ReportData) -> list[tuple[str, int]]:
    verdicts = [claim.verdict for claim in data.claims]
    return [(verdict, verdicts.count(verdict)) for verdict in VERDICTS if verdict in verdicts]
