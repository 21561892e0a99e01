"""Reads what the DAG left and turns it into the content of the start page."""

import os
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import Any

from mtcsirl.claims.claims import GATE
from mtcsirl.claims.judging import SHOWN
from mtcsirl.claims.unit_text import power_text
from mtcsirl.errors import MissingError, UserError
from mtcsirl.figures import figure_spec
from mtcsirl.figures.style import caption_of
from mtcsirl.files import storage
from mtcsirl.report.content import (
    Claim,
    DeviationLine,
    FigureView,
    GateLine,
    ReportData,
    StageCost,
    TableView,
    TargetLine,
    UnitLine,
    WhatWasRun,
)
from mtcsirl.report.measured import measured
from mtcsirl.settings import Settings
from mtcsirl.settings.template import deviations
from mtcsirl.study.design import ARTEFACTS, design
from mtcsirl.study.outputs import OUTPUTS
from mtcsirl.study.runs import AnyRun, Runs
from mtcsirl.tables.table import Table

SUMMARY_TARGETS = {"claims": "the verdicts on all claims", "report": "this page", "all": "everything"}


def collect(settings: Settings, page: Path, *, partial: bool = False) -> ReportData:
    """The content of the page that will lie at ``page``; links are relative to it.

    Raises UserError when something is missing and ``partial`` is false.
    """
    study = design(settings)
    results, claims = Path(settings.results), Path(settings.results) / "claims" / "claims"
    provenance = {run: found for run in study if (found := _json(run, settings, "provenance.json"))}
    missing = [(name, _title(name)) for name in ARTEFACTS if not _picture_or_table(name, settings).is_file()]
    if missing and not partial:
        path = _picture_or_table(missing[0][0], settings)
        raise MissingError(f"{path}: not there")
    there = [name for name in ARTEFACTS if name not in dict(missing)]
    judged = _judged(claims.with_suffix(".json"), partial)
    verdicts = claims_of(judged, claims.with_suffix(".json"))
    _check_runs(verdicts, settings, claims.with_suffix(".json"))
    return ReportData(
        run=_what_was_run(settings, study, provenance),
        claims=verdicts,
        tables=tuple(_table(name, settings, page) for name in there if name.startswith("table_")),
        figures=tuple(_figure(name, settings, page) for name in there if name.startswith("figure_")),
        gates=_gates(study, results),
        deviations=tuple(_deviation_lines(settings)),
        targets=tuple(_targets(settings, study, provenance)),
        missing=tuple(missing),
        links=_links(
            page, (("every number (JSON)", claims.with_suffix(".json")), ("Markdown", claims.with_suffix(".md")))
        ),
        claims_picture=_optional_picture("claims_picture", "All verdicts", claims.with_suffix(".png")),
        rows=_rows(settings, study, page),
        beforehand=str(judged.get("beforehand", "")),
    )


def _title(name: str) -> str:
    if name.startswith("figure_"):
        return figure_spec(name).title
    return TABLE_TITLES[name]


TABLE_TITLES = {
    "table_1": "Action norm: learned on several targets, tried on new targets and other tasks",
    "table_2": "Unseen tasks: all methods",
    "table_3": "Velocity: learned on several targets, tried on new targets and other tasks",
    "table_4": "MT-CSIRL+LT: both rewards learned, agents from scratch",
    "table_5": "Hyperparameters of SAC",
}


TABLE_FILES = (("its rows (CSV)", "csv"), ("Markdown", "md"), ("LaTeX", "tex"), ("JSON", "json"))


def _picture_or_table(name: str, settings: Settings) -> Path:
    if name.startswith("figure_"):
        return Path(settings.figures) / f"{name}.png"
    return Path(settings.results) / "tables" / f"{name}.json"


def _table(name: str, settings: Settings, page: Path) -> TableView:
    path = _picture_or_table(name, settings)
    table = Table.from_json(storage.read_json(path), path)
    files = tuple((text, path.with_suffix(f".{ending}")) for text, ending in TABLE_FILES)
    picture = _optional_picture(f"{name}_picture", f"{table.title} as a heat map", path.with_suffix(".png"))
    return TableView(name, _title(name), table, _links(page, files), picture)


def _figure(name: str, settings: Settings, page: Path) -> FigureView:
    path = _picture_or_table(name, settings)
    png = storage.read_bytes(path)
    record = Path(settings.results) / "artefacts" / name / "identity.json"
    links = _links(page, (("PDF", path.with_suffix(".pdf")), ("PNG", path), ("its runs (JSON)", record)))
    return FigureView(name, _title(name), caption_of(png), png, links)


ROWS = ("evaluation.csv", "scores.csv", "gate.json")
"""The file of a run that holds its rows: the first of these that its stage writes."""


def _rows(settings: Settings, study: Runs, page: Path) -> dict[str, str]:
    """Where the rows of each run are that is there."""
    files = {run.folder: next(name for name in ROWS if name in OUTPUTS[run.stage]) for run in study}
    paths = {folder: Path(settings.results) / folder / name for folder, name in files.items()}
    return {folder: address for folder, path in paths.items() for _, address in _links(page, (("", path),))}


def _optional_picture(name: str, title: str, path: Path) -> FigureView | None:
    """A picture that not every study has."""
    if not path.is_file():
        return None
    png = storage.read_bytes(path)
    return FigureView(name, title, caption_of(png), png)


def _links(page: Path, files: tuple[tuple[str, Path], ...]) -> tuple[tuple[str, str], ...]:
    """Addresses relative to the page of those files that are there."""
    return tuple((text, Path(os.path.relpath(file, page.parent)).as_posix()) for text, file in files if file.is_file())


def _targets(settings: Settings, study: Runs, provenance: dict[AnyRun, dict[str, Any]]) -> Iterator[TargetLine]:
    """Every artefact with the cost of the runs that it needs, as measured; artefacts share runs."""
    wanted = {name: (_title(name), design(settings, name)) for name in ARTEFACTS}
    for name, (text, own) in (wanted | {name: (text, study) for name, text in SUMMARY_TARGETS.items()}).items():
        costs = [provenance[run]["cost"]["cpu_seconds"] for run in own if run in provenance]
        yield TargetLine(name, text, len(costs), sum(own.jobs().values()), sum(costs))


def _what_was_run(settings: Settings, study: Runs, provenance: dict[AnyRun, dict[str, Any]]) -> WhatWasRun:
    return WhatWasRun(
        scale=settings.scale,
        seeds=settings.seeds,
        commits=_distinct(found["commit"] for found in provenance.values()),
        machines=_distinct(_machine(found["machine"]) for found in provenance.values()),
        versions=next((found["versions"] for found in provenance.values()), {}),
        stages=tuple(_stage_cost(stage, study, provenance) for stage in OUTPUTS),
    )


def _json(run: AnyRun, settings: Settings, name: str) -> dict[str, Any] | None:
    path = Path(settings.results) / run.folder / name
    return storage.read_json(path) if path.is_file() else None


def _machine(found: dict[str, Any]) -> str:
    return f"{found['processor']}, {found['cores']} cores, {found['system']}, Python {found['python']}"


def _stage_cost(stage: str, study: Runs, provenance: dict[AnyRun, dict[str, Any]]) -> StageCost:
    costs = [found["cost"] for run, found in provenance.items() if run.stage == stage]
    return StageCost(
        stage=stage,
        done=len(costs),
        planned=study.jobs().get(stage, 0),
        cpu_seconds=sum(cost["cpu_seconds"] for cost in costs),
        peak_memory_mib=max((cost["peak_memory_mib"] for cost in costs), default=0.0),
    )


def _distinct(items: Iterator[str]) -> tuple[str, ...]:
    return tuple(dict.fromkeys(items))


def _judged(path: Path, partial: bool) -> dict[str, Any]:
    """``claims.json``; empty if there is none yet and ``partial``."""
    return {"claims": []} if partial and not path.is_file() else storage.read_json(path)


def _check_runs(claims: Iterable[Claim], settings: Settings, path: Path) -> None:
    """No verdict stands on runs that are not there, as those of a file left by another study do."""
    folders = {folder for claim in claims for unit in claim.units for folder in unit.folders}
    gone = sorted(folder for folder in folders if not (Path(settings.results) / folder).is_dir())
    if gone:
        raise UserError(f"{path}: judged {gone[0]}, which is not there; judge again by mtcsirl claims --partial")


def claims_of(judged: dict[str, Any], path: Path | str = "claims.json") -> tuple[Claim, ...]:
    """The claims of ``claims.json``.

    Raises UserError when they are something else.
    """
    try:
        return tuple(_claim(found) for found in judged["claims"])
    except (KeyError, TypeError) as error:
        raise UserError(f"{path}: not the claims of this suite ({error}); delete it and make it again") from error


def _claim(found: dict[str, Any]) -> Claim:
    texts = {name: found[name] for name in ("name", "text", "locus", "criterion", "verdict", "reason")}
    return Claim(
        **texts,
        units=tuple(map(_unit, found["units"])),
        measured=measured(found["units"]),
        gate=found["role"] == GATE,
        departures=tuple((departure["leans"], departure["text"]) for departure in found["departures"]),
    )


def _unit(found: dict[str, Any]) -> UnitLine:
    power = "" if found["power"] is None else power_text(found["power"])
    return UnitLine(
        texts=found["texts"],
        state=found["answer"],
        outcome=found["outcome"],
        value=found["measure"]["value"],
        remarks=tuple(filter(None, [power, *found["notes"]])),
        judged=found["answer"] != SHOWN,
        folders=tuple(found["folders"]),
    )


def _gates(study: Runs, results: Path) -> tuple[GateLine, ...]:
    """One line per kind of agent, task and cs-reward; an IRL run has one gate per generator."""
    groups: dict[tuple[str, str, str], list[tuple[str, dict[str, Any]]]] = {}
    for run in study:
        path = results / run.folder / "gate.json"
        if "gate.json" in OUTPUTS[run.stage] and path.is_file():
            for task, gate in _members(run, storage.read_json(path)):
                key = (_agent_name(run), task, _cs_reward(run))
                groups.setdefault(key, []).append((run.folder, gate))
    return tuple(_gate_line(key, *zip(*found, strict=True)) for key, found in groups.items())


def _members(run: AnyRun, gate: dict[str, Any]) -> Iterator[tuple[str, dict[str, Any]]]:
    if "members" in gate:
        for verdict in gate["members"]:
            yield verdict["task"], verdict
    else:
        yield str(run.key["task"]), gate


AGENT_NAMES = {
    "train_expert": "expert",
    "train_sac": "SAC",
    "collect_demonstrations": "demonstrations",
    "learn_reward": "generator",
    "transfer": "transfer agent",
}


def _agent_name(run: AnyRun) -> str:
    """As in ``transfer agent, multi_task, mt_csirl``."""
    irl = getattr(run, "irl", run)
    parts = [AGENT_NAMES[run.stage], *(getattr(irl, name, "") for name in ("experiment", "method"))]
    return ", ".join(part.replace("_", " ") for part in parts if part)


def _cs_reward(run: AnyRun) -> str:
    return str(getattr(getattr(run, "irl", run), "cs_reward", ""))


def _gate_line(key: tuple[str, str, str], folders: Sequence[str], gates: Sequence[dict[str, Any]]) -> GateLine:
    metrics = [gate["metric"] for gate in gates if gate.get("metric") is not None]
    return GateLine(
        *key,
        passed=sum(gate["passed"] for gate in gates),
        agents=len(gates),
        success=sum(gate["success"] for gate in gates) / len(gates),
        metric=sum(metrics) / len(metrics) if metrics else None,
        folders=tuple(dict.fromkeys(folders)),
    )


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
