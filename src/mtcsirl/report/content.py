"""What the start page shows, as plain data: no file is read and none is written here."""

from collections.abc import Mapping
from dataclasses import dataclass, field

from mtcsirl.tables.table import Table


@dataclass(frozen=True)
class StageCost:
    """The runs of one stage: how many there are of how many, and what they cost."""

    stage: str
    done: int
    planned: int
    cpu_seconds: float
    peak_memory_mib: float


@dataclass(frozen=True)
class WhatWasRun:
    """Scale, seeds, code and machines; more than one commit or machine is a reason to look twice."""

    scale: str
    seeds: tuple[int, ...]
    commits: tuple[str, ...]
    machines: tuple[str, ...]
    versions: dict[str, str]
    stages: tuple[StageCost, ...]


@dataclass(frozen=True)
class UnitLine:
    """One unit of a claim: the texts of ``unit_text.COLUMNS``, its state, what became of its agents, and remarks.

    ``value``: of what the criterion looks at; ``judged``: false of units that stand beside the judged ones for
    comparison and count nowhere.
    """

    texts: Mapping[str, str]
    state: str
    outcome: str = ""
    value: float | None = None
    remarks: tuple[str, ...] = ()
    judged: bool = True
    folders: tuple[str, ...] = ()
    """Of the runs that were looked at, below the results."""


@dataclass(frozen=True)
class Claim:
    """One claim with its verdict and units.

    ``measured``: what the criterion looks at, with its interval, in one line; ``gate``: settings were chosen until it
    passed; ``departures``: (``for`` or ``against``, text) of each way in which this study's settings lean.
    """

    name: str
    text: str
    locus: str
    criterion: str
    verdict: str
    reason: str
    units: tuple[UnitLine, ...] = ()
    measured: str = ""
    gate: bool = False
    departures: tuple[tuple[str, str], ...] = ()

    @property
    def judged(self) -> int:
        """How many units count."""
        return sum(unit.judged for unit in self.units)


@dataclass(frozen=True)
class TableView:
    """A table and where its files are: ``links`` are (text, relative address)."""

    name: str
    title: str
    table: Table
    links: tuple[tuple[str, str], ...] = ()
    picture: "FigureView | None" = None
    """The table as a heat map, where there is one."""


@dataclass(frozen=True)
class FigureView:
    """A figure: its PNG file, caption and links."""

    name: str
    title: str
    caption: str
    png: bytes
    links: tuple[tuple[str, str], ...] = ()


@dataclass(frozen=True)
class GateLine:
    """Agents of one kind, task and cs-reward: how many passed their gate, their mean success and metric."""

    gate: str
    task: str
    cs_reward: str
    passed: int
    agents: int
    success: float | None
    metric: float | None
    folders: tuple[str, ...] = ()


@dataclass(frozen=True)
class DeviationLine:
    """A setting that differs from the paper's."""

    key: str
    ours: str
    paper: str
    text: str


@dataclass(frozen=True)
class TargetLine:
    """How to rerun one item: the name of its target, what that makes, and the runs and core seconds behind it.

    ``cpu_seconds`` were measured on the runs that are there (``done`` of ``planned``).
    """

    target: str
    text: str
    done: int
    planned: int
    cpu_seconds: float


@dataclass(frozen=True)
class ReportData:
    """Everything on the page. ``missing`` maps an artefact that is not there to its title."""

    run: WhatWasRun
    claims: tuple[Claim, ...]
    tables: tuple[TableView, ...]
    figures: tuple[FigureView, ...]
    gates: tuple[GateLine, ...]
    deviations: tuple[DeviationLine, ...]
    targets: tuple[TargetLine, ...]
    missing: tuple[tuple[str, str], ...] = ()
    links: tuple[tuple[str, str], ...] = ()
    claims_picture: FigureView | None = None
    """All verdicts on one page, where it has been drawn."""
    rows: Mapping[str, str] = field(default_factory=dict)
    """Folder of a run -> address of its rows, of those that are there."""
    cautions: tuple[str, ...] = ()
    """Runs and artefacts that are left out, or older than their runs: why, and the way out; one line each."""
    beforehand: str = ""
    """What was fixed before the runs and what was not."""
