"""``docs/results.md``: verdicts and tables of a study as one page of plain Markdown, for reading without the report.

What has not been run is named in one line, not spelled out.
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from mtcsirl.claims.claims import NEVER_RUN, Finding, claims_markdown
from mtcsirl.files import storage
from mtcsirl.results.notes import deviation_notes, of_kind, study_note
from mtcsirl.settings import Settings
from mtcsirl.study.runs import AnyRun
from mtcsirl.study.standing import DONE, standing
from mtcsirl.tables.table import Table

MACHINE = ("processor", "cores", "openblas", "system", "python")
"""What the page says of the machines, beside the commit."""
HEAD = """\
# Results

Written by `{command}`; edit nothing here. {scale}.
The paper's numbers stand beside ours; how each claim was judged stands in
[the criteria](../src/mtcsirl/claims/claims.yaml).
"""


def made_with(study: Iterable[AnyRun], settings: Settings) -> dict[str, str]:
    """Commits and machines of the runs that are done, by their provenance: each value once, a dash without a run.

    Raises:
        UserError: the provenance of a run is lost or unreadable.
    """
    done = [run for run in study if standing(run, settings).state == DONE]
    read = [storage.read_json(Path(settings.results) / run.folder / "provenance.json") for run in done]
    found: dict[str, list[str]] = {name: [] for name in ("commit", *MACHINE)}
    for said in read:
        for name, values in found.items():
            values.append(_cell(said if name == "commit" else _of(said, "machine"), name))
    return {name: ", ".join(dict.fromkeys(values)) or "–" for name, values in found.items()}


def _of(said: Any, name: str) -> Any:
    return said.get(name) if isinstance(said, Mapping) else None


def _cell(said: Any, name: str) -> str:
    value = _of(said, name)
    return "unknown" if value is None else " ".join(str(value).replace("|", "/").split())


def results_page(
    findings: Sequence[Finding],
    tables: Mapping[str, Table],
    settings: Settings,
    *,
    provenance: Mapping[str, Any] | None = None,
    command: str = "mtcsirl results",
) -> str:
    """The page: what was run, verdicts, tables, deviations once (and not under each table)."""
    parts = [HEAD.format(command=command, scale=study_note(settings).text).rstrip()]
    if provenance:
        rows = ["| | |", "| :-- | :-- |", *(f"| {name} | {value} |" for name, value in provenance.items())]
        parts.append("\n".join(rows))
    parts += ["## Which claims hold", *_claims(findings, settings)]
    parts += ["## Tables", *_tables(tables)]
    parts += ["## Deviations from the paper", *_deviations(settings, any(not t.is_empty for t in _results_of(tables)))]
    return "\n\n".join(parts) + "\n"


def _claims(findings: Sequence[Finding], settings: Settings) -> Iterator[str]:
    judged = [finding for finding in findings if finding.verdict != NEVER_RUN]
    if judged:
        yield claims_markdown(judged, settings).rstrip()
    waiting = [finding.name for finding in findings if finding.verdict == NEVER_RUN]
    if waiting:
        yield f"Not run yet: {', '.join(waiting)}."


def _tables(tables: Mapping[str, Table]) -> Iterator[str]:
    for table in tables.values():
        if not table.is_empty:
            yield from (f"### {table.title}", table.brief())
    empty = [table.title for table in tables.values() if table.is_empty]
    if empty:
        yield f"No run yet, or no part of this study: {', '.join(empty)}."


def _results_of(tables: Mapping[str, Table]) -> list[Table]:
    """The tables that are made from runs; Table 5 is made from the settings alone."""
    return [table for table in tables.values() if "n" in table.numbers]


def _deviations(settings: Settings, some_results: bool) -> Iterator[str]:
    notes = deviation_notes(settings)
    found = of_kind(notes, "deviation")
    if not some_results and found:
        yield f"{len(found)} settings differ from the paper's; `mtcsirl deviations` prints them."
    else:
        yield "\n".join(f"- {note.text}" for note in notes)
