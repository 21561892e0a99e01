"""Made-up results of a study, as frames and as files."""

from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any
from zlib import crc32

import numpy as np
import pandas as pd

from mtcsirl.files import storage
from mtcsirl.files.identity import FILE, Record, checksums, dumps, result_files
from mtcsirl.names import DIVERGED, KEPT, distance_metric
from mtcsirl.results.agents import agents, run_key
from mtcsirl.results.rows import KEY, OK, POLICIES, ROW_COLUMNS, metrics
from mtcsirl.rewards.ground_truth import COMMON_SENSE_REWARDS
from mtcsirl.settings import Settings
from mtcsirl.study.keys import identity_of
from mtcsirl.study.runs import AnyRun, Demonstrations, Runs

Means = Callable[[dict[str, Any]], dict[str, float]]
"""Means of the metrics of an agent, from its key."""


def complete(means: dict[str, float]) -> dict[str, float]:
    """``means`` with what they do not say: other metrics, and distances as if every step were like the mean."""
    found = {"success": 1.0, "velocity": 0.3, "action_norm": 1.6, "task_reward": 8.0} | means
    used = [name for name in found if name in COMMON_SENSE_REWARDS]
    return {distance_metric(name): abs(found[name] - COMMON_SENSE_REWARDS[name].target) for name in used} | found


def noise(agent: dict[str, Any], metric: str, policy: str) -> float:
    """One number in [-1, 1] for each agent, metric and policy, the same in every process."""
    text = "|".join(str(agent[name]) for name in KEY) + metric + policy
    return crc32(text.encode()) / 2**31 - 1


def evaluation(study: Runs, means: Means, spread: float = 0.0) -> pd.DataFrame:
    """Rows as ``evaluation_rows`` gives them, every run present, value = mean (1 + spread x noise)."""
    keys, rows = _frame(study)
    centres = [complete(means(key)) for key in keys]
    pairs = zip(rows["agent"], rows["metric"], strict=True)
    centre = np.array([centres[agent][metric] for agent, metric in pairs])
    return rows.assign(value=centre * (1 + spread * rows["noise"]))[list(ROW_COLUMNS)]


@cache
def _frame(study: Runs) -> tuple[list[dict[str, Any]], pd.DataFrame]:
    """The keys of all agents, and their rows without values."""
    keys, rows = [], []
    for run in study:
        for key in agents(run):
            keys.append(key)
            own = key | {
                "agent": len(keys) - 1,
                "kept": KEPT,
                "episodes": 10,
                "diverged": 0,
                "status": OK,
                "lacks": "",
                "folder": f"results/{run.folder}",
            }
            for policy in POLICIES:
                for metric in metrics(study):
                    jitter = noise(key, metric, policy)
                    rows.append(own | {"policy": policy, "metric": metric, "noise": jitter})
    for run in study.demonstrations:
        keys.append(run_key(run) | {"task": run.task, "target": run.target, "seed": run.expert.seed})
        own = keys[-1] | {
            "agent": len(keys) - 1,
            "kept": KEPT,
            "episodes": 0,
            "diverged": 0,
            "status": OK,
            "lacks": "",
            "folder": f"results/{run.folder}",
        }
        rows += [
            own | {"policy": "stochastic", "metric": metric, "noise": 0.0} for metric in ("success", run.cs_reward)
        ]
    return keys, pd.DataFrame(rows)


def sign(run: AnyRun, settings: Settings) -> None:
    """Sign whatever lies in the folder of ``run`` as what ``settings`` ask for."""
    folder = Path(settings.results) / run.folder
    record = Record(identity_of(run, settings), checksums(folder, result_files(folder)))
    storage.write_text(folder / FILE, dumps(record))


def write_demonstrations(run: Demonstrations, settings: Settings, *, passed: bool = True) -> None:
    """The gate of one expert's demonstrations."""
    gate = {"gate": "expert", "passed": passed, "success": 1.0 if passed else 0.6, "metric": 0.75}
    storage.write_json(Path(settings.results) / run.folder / "gate.json", gate)
    sign(run, settings)


def write_run(run: Any, settings: Settings, means: Means, *, episodes: int = 2, passed: bool = True) -> None:
    """The files of one run that evaluates agents."""
    rows, curve = [], []
    for agent in agents(run):
        values = complete(means(agent))
        own = {name: agent[name] for name in ("task", "target", "cs_reward", "seed")}
        for policy in POLICIES:
            for metric in values:
                centre = values[metric] + 0.01 * noise(agent, metric, policy)
                shifts = np.linspace(-0.1, 0.1, episodes)
                rows += [
                    own | {"policy": policy, "kept": KEPT, "episode": i, "metric": metric, "value": centre + shift}
                    for i, shift in enumerate(shifts)
                ]
            rows += [
                own | {"policy": policy, "kept": KEPT, "episode": i, "metric": DIVERGED, "value": 0.0}
                for i in range(episodes)
            ]
        curve += [own | {"step": step, "metric": "velocity", "value": values["velocity"]} for step in (500, 1000)]
    folder = Path(settings.results) / run.folder
    storage.write_csv(folder / "evaluation.csv", pd.DataFrame(rows))
    storage.write_csv(folder / "curve.csv", pd.DataFrame(curve))
    storage.write_json(folder / "gate.json", {"gate": "expert", "passed": passed, "success": 1.0, "metric": 0.75})
    sign(run, settings)
