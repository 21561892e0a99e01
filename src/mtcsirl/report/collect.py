"""Reads what the DAG left and turns it into the content of the start page.

What the page says is of runs that are done, and of artefacts that were made, under the settings that it names; what
lies there beside these is left out, counted and named with the way out.
"""

from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any

from mtcsirl.report.content import DeviationLine, ReportData, StageCost, TargetLine, WhatWasRun
from mtcsirl.report.gate_lines import gate_lines
from mtcsirl.report.pages_there import PagesThere
from mtcsirl.report.runs_there import Told, runs_there
from mtcsirl.report.views import Judged, Views, title_of
from mtcsirl.settings import Settings
from mtcsirl.settings.template import deviations
from mtcsirl.study.design import ARTEFACTS, CLAIMS, design
from mtcsirl.study.outputs import OUTPUTS
from mtcsirl.study.runs import AnyRun, Runs

SUMMARY_TARGETS = {"claims": "the verdicts on all claims", "report": "this page", "all": "everything"}


def collect(settings: Settings, page: Path, *, partial: bool = False) -> ReportData:
    """The content of the page that will lie at ``page``; links are relative to it.

    Raises UserError when a run or an artefact is missing, stale or damaged and ``partial`` is false.
    """
    study = design(settings)
    runs = runs_there(study, settings, partial=partial)
    views, pages = Views(settings, page), PagesThere(settings, runs.done, partial)
    tables = [pages.read(name, views.table) for name in ARTEFACTS if name.startswith("table_")]
    figures = [pages.read(name, views.figure) for name in ARTEFACTS if name.startswith("figure_")]
    judged = pages.read(CLAIMS, views.verdicts) or Judged()
    return ReportData(
        run=_what_was_run(settings, study, runs.told),
        claims=judged.claims,
        tables=tuple(view for view in tables if view is not None),
        figures=tuple(view for view in figures if view is not None),
        gates=gate_lines(runs.told),
        deviations=tuple(_deviation_lines(settings)),
        targets=tuple(_targets(settings, study, runs.told)),
        missing=tuple((name, title_of(name)) for name in pages.missing if name != CLAIMS),
        links=judged.links,
        claims_picture=judged.picture,
        rows=_rows(settings, runs.told, views),
        beforehand=judged.beforehand,
        cautions=(*runs.cautions, *pages.cautions),
    )


ROWS = ("evaluation.csv", "scores.csv", "gate.json")
"""The file of a run that holds its rows: the first of these that its stage writes."""


def _rows(settings: Settings, told: Iterable[AnyRun], views: Views) -> dict[str, str]:
    """Where the rows of each run are."""
    names = {run.folder: next(name for name in ROWS if name in OUTPUTS[run.stage]) for run in told}
    return dict(views.links((folder, Path(settings.results) / folder / name) for folder, name in names.items()))


def _targets(settings: Settings, study: Runs, told: Mapping[AnyRun, Told]) -> Iterator[TargetLine]:
    """Every artefact with the cost of the runs that it needs, as measured; artefacts share runs."""
    wanted = {name: (title_of(name), design(settings, name)) for name in ARTEFACTS}
    for name, (text, own) in (wanted | {name: (text, study) for name, text in SUMMARY_TARGETS.items()}).items():
        costs = [told[run].cpu_seconds for run in own if run in told]
        yield TargetLine(name, text, len(costs), sum(own.jobs().values()), sum(costs))


def _what_was_run(settings: Settings, study: Runs, told: Mapping[AnyRun, Told]) -> WhatWasRun:
    return WhatWasRun(
        scale=settings.scale,
        seeds=settings.seeds,
        commits=_distinct(found.commit for found in told.values()),
        machines=_distinct(found.machine for found in told.values()),
        versions=next((dict(found.versions) for found in told.values()), {}),
        stages=tuple(_stage_cost(stage, study, told) for stage in OUTPUTS),
    )


def _stage_cost(stage: str, study: Runs, told: Mapping[AnyRun, Told]) -> StageCost:
    own = [found for run, found in told.items() if run.stage == stage]
    return StageCost(
        stage=stage,
        done=len(own),
        planned=study.jobs().get(stage, 0),
        cpu_seconds=sum(found.cpu_seconds for found in own),
        peak_memory_mib=max((found.peak_memory_mib for found in own), default=0.0),
    )


def _distinct(items: Iterator[str]) -> tuple[str, ...]:
    return tuple(dict.fromkeys(items))


def _deviation_lines(settings: Settings) -> Iterator[DeviationLine]:
    for found in deviations(settings):
        unit = f" {found.unit}" if found.unit else ""
        yield DeviationLine(found.key, f"{_plain(found.ours)}{unit}", _plain(found.paper), found.text)


def _plain(value: Any) -> str:
    """A settings value in words: lists and mappings without their brackets."""
    if isinstance(value, dict):
        return ", ".join(f"{name}: {_plain(item)}" for name, item in value.items())
    if isinstance(value, tuple | list):
        return ", ".join(map(_plain, value))
    return f"{value:,}" if isinstance(value, int) and not isinstance(value, bool) else str(value)
