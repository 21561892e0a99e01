"""A small study, finished and made up, whose runs have files of all their kinds."""

from itertools import count
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import torch

from mtcsirl.episodes.gates import gate_verdict, stochastic_means
from mtcsirl.episodes.policy import Policy, save_policy
from mtcsirl.files import storage
from mtcsirl.files.identity import FILE, Record, checksums, dumps, read_record, result_files
from mtcsirl.files.provenance import Stopwatch, write_provenance
from mtcsirl.results import archive
from mtcsirl.rewards.learned import LearnedReward, save_learned_reward
from mtcsirl.rewards.networks import RewardNetwork
from mtcsirl.settings import EvaluationSettings, Settings
from mtcsirl.study.design import design
from mtcsirl.study.keys import identity_of
from mtcsirl.study.outputs import OUTPUTS
from mtcsirl.study.runs import AnyRun, Demonstrations, Expert, IrlRun, Score
from tests.results.made_up import write_demonstrations, write_run

SEVERAL = {
    "seeds": (0,),
    "irl_seeds": (0,),
    "cs_rewards": ("velocity",),
    "methods": ("mt_csirl",),
    "single_target": {"tasks": ("push-back",)},
    "multi_target": {"tasks": ("push-back",), "train_targets": (1,)},
    "multi_task": {"train_tasks": ("reach", "door-close"), "train_targets": (1,), "unseen_tasks": ("push-back",)},
    "evaluation": EvaluationSettings(episodes=2),
}
STUDY = design(Settings(**SEVERAL))
SCORED = {"expert/velocity/push-back-t0/s0", "sac/push-back-t0/s0"}
IRL = next(run for run in STUDY.irl_runs if run.experiment == "multi_task")
SHOWN = IRL.demonstrations[0]
SCORE = STUDY.scores[0]
ARCHITECTURE = {
    "kind": "perceptron", "observation_size": 39, "action_size": 4, "hidden_sizes": [8],
    "output_scale": 10.0, "shaping": False, "discount": 0.99,
}  # fmt: skip


def settings(results: Path) -> Settings:
    return Settings(**SEVERAL, results=str(results))


def _policy(seed: int) -> Policy:
    random = np.random.default_rng(seed)
    shapes = ((6, 39), (8, 6))
    weights = tuple(random.standard_normal(shape).astype(np.float32) for shape in shapes)
    return Policy(weights, tuple(np.zeros(shape[0], np.float32) for shape in shapes))


def _diagnostics(run: IrlRun) -> pd.DataFrame:
    rows = [
        {"task": task, "target": target, "step": 500 * i, "discriminator": name, "metric": "accuracy", "value": i / 7}
        for i in range(1, 24)
        for task, target in run.members
        for name in ("", "reach-t1")
    ]
    return pd.DataFrame(rows)


def reward(run: IrlRun) -> LearnedReward:
    network = RewardNetwork(ARCHITECTURE, random=torch.Generator().manual_seed(3))
    return LearnedReward(network, run.method, run.cs_reward, "mapped", run.members)


def write(run: AnyRun, at: Settings, velocity: float = 0.7) -> None:
    """The real kinds of files of a run, small."""
    folder = Path(at.results) / run.folder
    if isinstance(run, Demonstrations):
        write_demonstrations(run, at)
        storage.write_parquet(folder / "demonstrations.parquet", pd.DataFrame({"episode": range(3)}))
    elif isinstance(run, Score):
        scores = {"transitions": "expert", "statistic": "pearson", "value": 1 / 3, "low": [np.nan, 0.1], "n": 5}
        storage.write_csv(folder / "scores.csv", pd.DataFrame(scores | {"high": np.nan}))
        points = {"transitions": "expert", "agent": np.arange(4, dtype=np.int32), "truth": np.ones(4, np.float32) / 3}
        storage.write_parquet(folder / "points.parquet", pd.DataFrame(points))
    else:
        write_run(run, at, lambda agent: {"velocity": velocity})
    if isinstance(run, IrlRun):
        save_learned_reward(reward(run), folder)
        storage.write_csv(folder / "diagnostics.csv", _diagnostics(run))
        storage.write_parquet(folder / "samples.parquet", pd.DataFrame({"step": range(3)}))
        for task, target in run.members:
            save_policy(_policy(target), folder / "policies", f"{task}-t{target}")
    elif "policy.json" in OUTPUTS[run.stage]:
        save_policy(_policy(4), folder)
    storage.write_json(folder / "settings.json", run.settings(at).model_dump(mode="json"))
    if (folder / "gate.json").is_file():
        storage.write_json(folder / "gate.json", gate(run, at))
    write_provenance(folder, _stopwatch())
    sign_with_inputs(run, at)


def gate(run: AnyRun, at: Settings) -> dict[str, Any]:
    """The gate that follows from the run's episodes."""
    limits, cs_reward = run.settings(at).gates, getattr(run, "cs_reward", "velocity")
    if isinstance(run, Demonstrations):
        return gate_verdict("expert", {"success": 1.0, "velocity": 0.75, "diverged": 0.0}, "velocity", limits)
    rows = storage.read_csv(Path(at.results) / run.folder / "evaluation.csv")
    if not isinstance(run, IrlRun):
        name = "expert" if isinstance(run, Expert) else "sac"
        return gate_verdict(name, stochastic_means(rows.to_dict("records")), cs_reward, limits)
    members = []
    for task, target in run.members:
        own = rows[(rows["task"] == task) & (rows["target"] == target)]
        verdict = gate_verdict("generator", stochastic_means(own.to_dict("records")), cs_reward, limits)
        members.append({"task": task, "target": target, **verdict})
    means = {name: float(np.mean([member[name] for member in members])) for name in ("success", "metric")}
    passed, diverged = all(one["passed"] for one in members), sum(one["diverged"] for one in members)
    said = {"gate": "generator", "passed": passed, "limits": members[0]["limits"], "diverged": diverged}
    return said | means | {"members": members}


def sign_with_inputs(run: AnyRun, at: Settings) -> None:
    """As :func:`sign`, with what the run read, where that is there."""
    results = Path(at.results)
    there = {role: read_record(results / needed.folder) for role, needed in run.needs.items()}
    read = {role: record.bytes for role, record in there.items() if record is not None}
    folder = results / run.folder
    record = Record(identity_of(run, at), checksums(folder, result_files(folder)), read)
    storage.write_text(folder / FILE, dumps(record))


_MADE = count(1)


def _stopwatch() -> Stopwatch:
    """No two runs take the same time."""
    watch = Stopwatch()
    watch.add({"wall_seconds": next(_MADE), "cpu_seconds": 0.0, "peak_memory_mib": 0.0})
    return watch


def add(folder: Path, results: Path) -> Path | None:
    return archive.add(folder, results, [run.folder for run in STUDY], archive.policies_kept(STUDY))
