"""``docs/results.md``: verdicts and tables of a study as one page of plain Markdown, for reading without the report."""

from collections.abc import Mapping, Sequence
from typing import Any

from mtcsirl.claims.claims import Finding, claims_markdown
from mtcsirl.settings import Settings
from mtcsirl.settings.template import deviations
from mtcsirl.tables.table import DIFFERS, Table, scale_notes

HEAD = """\
# Results

Written by `{command}`; edit nothing here. {scale}.
Every number is ours with the paper's below it; how each claim was judged stands in
[the criteria](../src/mtcsirl/claims/claims.yaml), fixed before the runs.
"""


def results_page(
    findings: Sequence[Finding],
    tables: Mapping[str, Table],
    settings: Settings,
    *,
    provenance: Mapping[str, Any] | None = None,
    command: str = "mtcsirl results",
) -> str:
    """The page: what was run, verdicts, tables, deviations once (and not under each table)."""
    parts = [HEAD.format(command=command, scale="; ".join(scale_notes(settings))).rstrip()]
    if provenance:
        parts += ["", "| | |", "| :-- | :-- |", *(f"| {name} | {value} |" for name, value in provenance.items())]
    parts += ["", "## Which claims hold", "", claims_markdown(findings, settings).rstrip()]
    parts += ["", "## Tables"]
    for table in tables.values():
        parts += ["", f"### {table.title}", "", _without_deviations(table)]
    parts += ["", "## Deviations from the paper", ""]
    parts += [f"- {deviation}" for deviation in deviations(settings)] or ["None."]
    return "\n".join(parts) + "\n"


def _without_deviations(table: Table) -> str:
    lines = table.markdown().splitlines()
    return "\n".join(line for line in lines if not line.startswith(f"- {DIFFERS}")).rstrip()
