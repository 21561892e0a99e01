"""A few runs of the evidence archive made again from what it holds, and held against it."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd

from mtcsirl.episodes.gates import stochastic_means
from mtcsirl.errors import UserError
from mtcsirl.files.identity import FILE, NOTE, Record, checksum, read_record
from mtcsirl.files.storage import read_csv
from mtcsirl.results.archive import Archived, another, read
from mtcsirl.results.packing import PROVENANCE
from mtcsirl.results.soundness import foreign
from mtcsirl.settings import Settings
from mtcsirl.study.keys import Run, identity_of
from mtcsirl.study.runs import AnyRun, Runs

AGENTS, IRL_RUNS = ("train_expert", "train_sac", "transfer"), ("learn_reward",)
POLICY = frozenset({"policy.json", "policy.safetensors"})
REWARD = frozenset({"reward.json", "reward.safetensors"})
READ: Mapping[str, frozenset[str]] = {
    "collect_demonstrations": POLICY,
    "learn_reward": frozenset({"demonstrations.parquet"}),
    "transfer": REWARD,
}
"""The files that a stage reads of the runs that it needs."""
EVALUATION = "evaluation.csv"
COMPARED = ("success", "velocity", "action_norm")
MEASURED = ("policy", "kept", "episode", "metric", "value")
"""Columns of an evaluation that a mean is taken from."""


def draw(known: Mapping[str, Archived], study: Runs, agents: int, irl_runs: int, seed: int) -> list[AnyRun]:
    """So many archived agents and IRL runs of ``study``, each with the same chance; the same for the same seed.

    Raises:
        UserError: the archive holds fewer.
    """
    random = np.random.default_rng(seed)
    drawn: list[AnyRun] = []
    for stages, count in ((AGENTS, agents), (IRL_RUNS, irl_runs)):
        of_stage = [run for run in study if run.stage in stages and run.folder in known]
        there = sorted(of_stage, key=lambda run: run.folder)
        if len(there) < count:
            raise UserError(f"the archive holds {len(there)} runs of {', '.join(stages)}; draw at most as many")
        drawn += [there[index] for index in sorted(random.choice(len(there), count, replace=False))]
    return drawn


def to_be_made(drawn: Iterable[AnyRun], known: Mapping[str, Archived]) -> set[str]:
    """Folders of the drawn runs and of those whose files they read that the archive had not kept."""
    left: list[Run[Any]] = list(drawn)
    found = set[str]()
    while left:
        run = left.pop()
        found.add(run.folder)
        for needed in run.needs.values():
            if needed.folder not in known or not known[needed.folder].kept >= READ[run.stage]:
                left.append(needed)
    return found


def refuse_others(drawn: Iterable[AnyRun], known: Mapping[str, Archived], settings: Settings) -> None:
    """Hold the drawn runs and what they come from against the archive, before anything is made.

    Raises:
        UserError: under ``settings`` and with this code one of them is another run.
    """
    for run in _from_the_first(drawn):
        if run.folder in known:
            why = another(known[run.folder].record.identity, identity_of(run, settings))
            if why:
                raise UserError(
                    f"{run.folder}: {why}; take the settings, scale and code that the archive was made with"
                )


def _from_the_first(drawn: Iterable[AnyRun]) -> Iterator[Run[Any]]:
    """Each run after those that it needs, so that the first difference is not that of an input."""
    for run in drawn:
        yield from _from_the_first(run.needs.values())  # type: ignore[arg-type]
        yield run


class Again(NamedTuple):
    """A run that was made again, beside the archived one."""

    folder: str
    files: int
    """Result files that the archive has a checksum of."""
    other: tuple[str, ...]
    """Those of other bytes."""
    apart: Mapping[str, tuple[float, float]]
    """Of an agent with other bytes: means over stochastic episodes, archived and made again, by metric."""


class Comparison(NamedTuple):
    """Archived runs that were made again, and those that stand there and cannot be compared: folder and why."""

    made: tuple[Again, ...]
    left_out: tuple[tuple[str, str], ...]


def compare(archive: Path, known: Mapping[str, Archived], results: Path) -> Comparison:
    """Every archived run that was made again below ``results``, whole and unchanged; restored ones are none."""
    others: dict[str, tuple[str, ...]] = {}
    left_out: list[tuple[str, str]] = []
    for folder, run in sorted(known.items()):
        if (results / folder / NOTE).is_file() or not (results / folder / FILE).is_file():
            continue
        try:
            record = _made_again(results / folder, run)
        except UserError as error:
            left_out.append((folder, str(error)))
            continue
        others[folder] = tuple(name for name, sha in run.record.files.items() if record.files.get(name) != sha)
    rows = read(archive, "evaluation") if any(EVALUATION in other for other in others.values()) else pd.DataFrame()
    found = []
    for folder, other in others.items():
        try:
            apart = _apart(rows, folder, archive, results / folder) if EVALUATION in other else {}
            found.append(Again(folder, len(known[folder].record.files), other, apart))
        except UserError as error:
            left_out.append((folder, str(error)))
    return Comparison(tuple(found), tuple(left_out))


def _made_again(folder: Path, run: Archived) -> Record:
    """The record in ``folder``, whose files are what it says.

    Raises:
        UserError: it is another run, not whole, was edited, or is the archive's own.
    """
    record = read_record(folder)
    assert record is not None
    if why := another(run.record.identity, record.identity):
        raise UserError(why)
    if strange := foreign(record):
        raise UserError(f"{strange[0]!r} is no file that its stage leaves")
    for name in (*record.files, PROVENANCE):
        if not (folder / name).is_file():
            raise UserError(f"lacks {name}, so that it is not whole or was restored without its note {NOTE}")
        if name in record.files and checksum(folder / name) != record.files[name]:
            raise UserError(f"{name} changed since its run wrote it")
    if checksum(folder / PROVENANCE) == run.provenance:
        raise UserError(f"was restored, not made again: its {PROVENANCE} is the archive's")
    return record


def _apart(rows: pd.DataFrame, folder: str, archive: Path, again: Path) -> dict[str, tuple[float, float]]:
    there = _means(rows[rows["folder"] == folder], f"{archive}: its evaluation")
    here = _means(read_csv(again / EVALUATION), f"its {EVALUATION}")
    return {metric: (there[metric], here[metric]) for metric in COMPARED}


def _means(rows: pd.DataFrame, what: str) -> dict[str, float]:
    lacks = [name for name in MEASURED if name not in rows]
    if not lacks:
        there = set(rows.loc[(rows["policy"] == "stochastic") & rows["value"].notna(), "metric"])
        lacks = [metric for metric in COMPARED if metric not in there]
    if lacks:
        raise UserError(f"{what} has no numbers for {', '.join(lacks)}")
    return stochastic_means(rows.to_dict("records"))  # type: ignore[arg-type]
