"""The start page as one HTML file: styles, pictures and one short script inside, nothing from a network."""

from base64 import b64encode
from collections.abc import Iterable
from hashlib import sha256
from importlib import resources

from jinja2 import Environment, StrictUndefined
from markupsafe import Markup

from mtcsirl.claims.judging import BLOCKED, MET, NOT_MET, NOT_RUN, SHOWN, TOO_FEW, UNCLEAR
from mtcsirl.claims.unit_text import COLUMNS
from mtcsirl.report.content import Claim, FigureView, ReportData
from mtcsirl.report.sources import entries
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
STATES = {
    MET: "good",
    NOT_MET: "bad",
    UNCLEAR: "open",
    TOO_FEW: "open",
    BLOCKED: "open",
    NOT_RUN: "none",
    SHOWN: "none",
}
"""The same of a unit's state."""
FURTHER = ("why", "ours_in_prediction", "paper_in_interval", "difference", "effect")
"""Texts of a unit that stand in its last column, each under its heading."""
CONFIGS = {"smoke": "--configfile config/smoke.yaml ", "paper": "--configfile config/paper.yaml "}
BESIDE: tuple[Kind, ...] = ("scale", "gap", "mark")
"""Notes that are read with a table; remarks are unfolded, and deviations have a section of their own."""


def build_report(data: ReportData) -> str:
    """The page; equal data gives equal text. Every text is escaped."""
    environment = Environment(autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True)
    environment.filters |= {
        "picture": _picture,
        "number": _number,
        "title": _title,
        "duration": _duration,
    }
    # Each name is a constant where its file is read: so the identity of the page knows these files.
    template = resources.files("mtcsirl.report").joinpath("page.html").read_text(encoding="utf-8")
    styles = resources.files("mtcsirl.report").joinpath("page.css").read_text(encoding="utf-8")
    rows = resources.files("mtcsirl.report").joinpath("rows.html").read_text(encoding="utf-8")
    script = resources.files("mtcsirl.report").joinpath("page.js").read_text(encoding="utf-8")
    known = entries(data)
    command = f"snakemake --cores 2 {CONFIGS.get(data.run.scale, '')}"
    scale = f" --scale {data.run.scale}" if data.run.scale in CONFIGS else ""
    return environment.from_string(template).render(
        data=data,
        anchor=lambda folders: known[tuple(folders)].anchor,
        rows=Markup(environment.from_string(rows).render(entries=list(known.values()), command=command, scale=scale)),
        css=Markup(styles),
        script=Markup(script),
        script_hash=b64encode(sha256(script.encode()).digest()).decode(),
        verdict_style=VERDICTS,
        state_style=STATES,
        verdict_counts={
            "Claims": _verdict_counts(claim for claim in data.claims if not claim.gate),
            "Gates": _verdict_counts(claim for claim in data.claims if claim.gate),
        },
        unit_columns=COLUMNS,
        further=FURTHER,
        warnings=scale_notes(data.run.scale),
        beside=lambda notes: of_kind(notes, *BESIDE),
        of_kind=of_kind,
        command=command,
    )


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


def _verdict_counts(claims: Iterable[Claim]) -> list[tuple[str, int]]:
    verdicts = [claim.verdict for claim in claims]
    return [(verdict, verdicts.count(verdict)) for verdict in VERDICTS if verdict in verdicts]
