"""A few runs of the evidence archive made again from what it holds, and held against it."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd

from mtcsirl.episodes.gates import stochastic_means
from mtcsirl.errors import UserError
from mtcsirl.files.identity import NOTE, read_record
from mtcsirl.files.storage import read_csv
from mtcsirl.results.archive import Archived, read
from mtcsirl.study.keys import Run
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


class Again(NamedTuple):
    """A run that was made again, beside the archived one."""

    folder: str
    files: int
    """Result files that the archive has a checksum of."""
    other: tuple[str, ...]
    """Those of other bytes."""
    apart: Mapping[str, tuple[float, float]]
    """Of an agent with other bytes: means over stochastic episodes, archived and made again, by metric."""


def compare(archive: Path, known: Mapping[str, Archived], results: Path) -> list[Again]:
    """Every archived run that was made again below ``results``; restored ones are none.

    Raises:
        UserError: a run there is of another identity: other settings or code.
    """
    others: dict[str, tuple[str, ...]] = {}
    for folder, run in sorted(known.items()):
        record = None if (results / folder / NOTE).is_file() else read_record(results / folder)
        if record is None:
            continue
        if record.identity.hash != run.record.identity.hash:
            raise UserError(f"{results / folder}: is another run than the archive's, by settings or code")
        others[folder] = tuple(name for name, sha in run.record.files.items() if record.files.get(name) != sha)
    rows = read(archive, "evaluation") if any(EVALUATION in other for other in others.values()) else pd.DataFrame()
    found = []
    for folder, other in others.items():
        apart = _apart(rows[rows["folder"] == folder], results / folder) if EVALUATION in other else {}
        found.append(Again(folder, len(known[folder].record.files), other, apart))
    return found


def _apart(rows: pd.DataFrame, folder: Path) -> dict[str, tuple[float, float]]:
    there, here = _means(rows), _means(read_csv(folder / EVALUATION))
    return {metric: (there[metric], here[metric]) for metric in COMPARED}


def _means(rows: pd.DataFrame) -> dict[str, float]:
    return stochastic_means(rows.to_dict("records"))  # type: ignore[arg-type]
