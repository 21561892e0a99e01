"""All results of a study as tidy frames, with what is missing or doubtful marked in them.

``evaluation_rows`` has one row per agent, policy and metric: the mean over the agent's evaluation episodes, and a
status. No row is dropped: a run that the study asks for and that is not there stands in the frame with value NaN.
"""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from mtcsirl.errors import UserError
from mtcsirl.files import storage
from mtcsirl.names import CS_REWARDS
from mtcsirl.study.runs import Baseline, Demonstrations, Expert, IrlRun, Run, Study, Transfer

KEY = ("stage", "experiment", "method", "cs_reward", "source", "task", "target", "seed")
ROW_COLUMNS = (*KEY, "policy", "metric", "value", "episodes", "status", "folder")
CURVE_COLUMNS = (*KEY, "step", "metric", "value")
RUN_KEY = ("experiment", "method", "cs_reward", "source", "seed")
SCORE_COLUMNS = (*RUN_KEY, "transitions", "reward", "statistic", "value", "low", "high", "n")
POINT_COLUMNS = (*RUN_KEY, "transitions", "episode", "truth", "learned", "task_reward")
EVALUATION_COLUMNS = ("task", "target", "seed", "policy", "episode", "metric", "value")

OK, BELOW_GATE, MISSING, DUPLICATED, FOREIGN = "ok", "below gate", "missing", "duplicated", "foreign"
"""Status of a run. Below gate: the agent did not learn what it had to; its value counts and is marked. Missing: no
evaluation. Duplicated: the numbers of another seed, or an episode twice. Foreign: the file names another task, target
or seed than its folder. The last three have the value NaN."""

POLICIES = ("stochastic", "deterministic")


def evaluation_rows(study: Study, results: Path | str, *, partial: bool = False) -> pd.DataFrame:
    """Every agent of ``study`` with its evaluation, ``ROW_COLUMNS``; agents are run x member for IRL runs.

    Demonstrations are rows too, of the stage ``collect_demonstrations`` with the seed of their expert: what their
    episodes reached and whether that passes the expert's gate.

    Raises:
        UserError: a run is missing and ``partial`` is false; a file is unreadable.
    """
    frames = []
    for run in study:
        for agent in agents(run):
            folder = Path(results) / run.folder
            if not (folder / "evaluation.csv").is_file():
                _demand(folder / "evaluation.csv", partial)
            frames.append(_agent_rows(agent, folder, metrics(study)))
    frames += [_demonstration_rows(run, Path(results) / run.folder, partial) for run in study.demonstrations]
    rows = pd.concat(frames, ignore_index=True) if frames else pd.DataFrame({name: [] for name in ROW_COLUMNS})
    return _mark_equal_seeds(rows[list(ROW_COLUMNS)])


def ablated_generators(study: Study, results: Path | str, experiment: str) -> pd.DataFrame:
    """The generators of a variant, with the name of its ablation as their experiment; runs that are not there: none.

    A variant has the keys of the main study's runs: without a name of their own they would be taken for those.
    """
    rows = evaluation_rows(study, results, partial=True)
    return select(rows, stage="learn_reward").assign(experiment=experiment)


def curve_rows(study: Study, results: Path | str, *, partial: bool = False) -> pd.DataFrame:
    """The learning curves of all agents of ``study``, ``CURVE_COLUMNS``; missing runs have no rows."""
    frames = []
    for run in study:
        path = Path(results) / run.folder / "curve.csv"
        own_agents = list(agents(run))
        if not own_agents or not _present(path, partial):
            continue
        curve = storage.read_csv(path, ("step", "metric", "value"))
        for agent in own_agents:
            own = curve
            if "task" in curve:
                own = curve[(curve["task"] == agent["task"]) & (curve["target"] == agent["target"])]
            frames.append(own[["step", "metric", "value"]].assign(**agent))
    return _joined(frames, CURVE_COLUMNS)


def score_rows(study: Study, results: Path | str, *, partial: bool = False) -> pd.DataFrame:
    """Correlations of learned and true rewards, ``SCORE_COLUMNS`` + task; missing runs have no rows."""
    return _of_scores(study, results, "scores.csv", (*SCORE_COLUMNS, "task"), partial)


def point_rows(study: Study, results: Path | str, *, partial: bool = False) -> pd.DataFrame:
    """Single transitions of those correlations, ``POINT_COLUMNS`` + task; missing runs have no rows."""
    return _of_scores(study, results, "points.parquet", (*POINT_COLUMNS, "task"), partial)


def _of_scores(study: Study, results: Path | str, name: str, columns: tuple[str, ...], partial: bool) -> pd.DataFrame:
    frames = []
    for run in study.scores:
        path = Path(results) / run.folder / name
        if _present(path, partial):
            frame = storage.read_parquet(path) if name.endswith("parquet") else storage.read_csv(path)
            frames.append(frame.assign(**{key: getattr(run.irl, key) for key in RUN_KEY}, task=run.task))
    return _joined(frames, columns)


def _joined(frames: list[pd.DataFrame], columns: tuple[str, ...]) -> pd.DataFrame:
    if not frames:
        return pd.DataFrame({name: [] for name in columns})
    return pd.concat(frames, ignore_index=True)[list(columns)]


def select(rows: pd.DataFrame, **key: Any) -> pd.DataFrame:
    """The rows whose columns have these values; a tuple or list means any of them."""
    for name, value in key.items():
        column = rows[name]
        rows = rows[column.isin(list(value)) if isinstance(value, tuple | list) else column == value]
    return rows


def matrix(rows: pd.DataFrame) -> pd.DataFrame:
    """Values [seed, task] of one agent's rows of one metric and policy; NaN where a seed is not usable.

    Raises:
        ValueError: the rows hold more than one value per seed and task, so the selection is not one agent.
    """
    if rows.duplicated(["seed", "task"]).any():
        raise ValueError("more than one row per seed and task: select one stage, method, source, policy and metric")
    return rows.pivot(index="seed", columns="task", values="value").astype(float)


def agents(run: Run) -> Iterator[dict[str, Any]]:
    """The ``KEY`` of each agent that ``run`` evaluates."""
    key = run_key(run)
    if isinstance(run, IrlRun):
        for task, target in run.members:
            yield key | {"task": task, "target": target, "seed": run.seed}
    elif isinstance(run, Expert | Baseline | Transfer):
        yield key | {"task": run.task, "target": run.target, "seed": run.seed}


def run_key(run: Run) -> dict[str, Any]:
    """The part of ``KEY`` that all agents of ``run`` share."""
    irl = run.irl if isinstance(run, Transfer) else run if isinstance(run, IrlRun) else None
    return {
        "stage": run.stage,
        "experiment": irl.experiment if irl else "",
        "method": irl.method if irl else "",
        "cs_reward": irl.cs_reward if irl else getattr(run, "cs_reward", ""),
        "source": irl.source if irl else "",
    }


def metrics(study: Study) -> tuple[str, ...]:
    """What an evaluation measures: the paper's two cs-rewards, further ones of this study, success, task reward."""
    used = dict.fromkeys((*CS_REWARDS, *(x.cs_reward for x in study.experts), *(x.cs_reward for x in study.irl_runs)))
    return ("success", *used, "task_reward")


def _agent_rows(agent: dict[str, Any], folder: Path, names: tuple[str, ...]) -> pd.DataFrame:
    """One row per policy and metric of one agent."""
    grid = pd.MultiIndex.from_product([POLICIES, names], names=["policy", "metric"])
    rows = pd.DataFrame({"value": np.nan, "episodes": 0}, index=grid)
    status = MISSING
    path = folder / "evaluation.csv"
    if path.is_file():
        episodes = storage.read_csv(path, EVALUATION_COLUMNS)
        own = episodes[(episodes["task"] == agent["task"]) & (episodes["target"] == agent["target"])]
        status = _status(agent, own, folder)
        groups = own.groupby(["policy", "metric"])["value"]
        rows["episodes"] = groups.size().reindex(grid, fill_value=0)
        if status in (OK, BELOW_GATE):
            rows["value"] = groups.mean().reindex(grid)
    return rows.reset_index().assign(**agent, status=status, folder=str(folder))


def _demonstration_rows(run: Demonstrations, folder: Path, partial: bool) -> pd.DataFrame:
    """Success and metric of one expert's demonstrations."""
    verdict: dict[str, Any] = {"success": np.nan, "metric": np.nan}
    status = MISSING
    if _present(folder / "gate.json", partial):
        verdict = storage.read_json(folder / "gate.json")
        status = OK if verdict["passed"] else BELOW_GATE
    key = run_key(run) | {"task": run.task, "target": run.target, "seed": run.expert.seed}
    rows = pd.DataFrame(
        {"policy": "stochastic", "metric": ["success", run.cs_reward], "value": [verdict["success"], verdict["metric"]]}
    )
    return rows.assign(**key, episodes=0, status=status, folder=str(folder))


def _status(agent: dict[str, Any], own: pd.DataFrame, folder: Path) -> str:
    if own.empty or (own["seed"] != agent["seed"]).any():
        return FOREIGN
    if own.duplicated(["policy", "episode", "metric"]).any():
        return DUPLICATED
    gate = folder / "gate.json"
    if gate.is_file():
        verdict = storage.read_json(gate)
        members = {(m["task"], m["target"]): m for m in verdict.get("members", [])}
        return OK if members.get((agent["task"], agent["target"]), verdict)["passed"] else BELOW_GATE
    return OK


def _mark_equal_seeds(rows: pd.DataFrame) -> pd.DataFrame:
    """Mark an agent that repeats the numbers of an earlier seed, as copied run folders do."""
    known = rows[rows["value"].notna()]
    if known.empty:
        return rows
    agent = known.assign(column=known["policy"] + " " + known["metric"])
    wide = agent.pivot(index=list(KEY), columns="column", values="value").reset_index()
    copies = wide[wide.duplicated([name for name in wide.columns if name != "seed"])]
    if copies.empty:
        return rows
    marked = pd.MultiIndex.from_frame(rows[list(KEY)]).isin(pd.MultiIndex.from_frame(copies[list(KEY)]))
    return rows.assign(
        value=rows["value"].mask(marked), status=rows["status"].mask(marked, DUPLICATED).astype(rows["status"].dtype)
    )


def _present(path: Path, partial: bool) -> bool:
    if path.is_file():
        return True
    _demand(path, partial)
    return False


def _demand(path: Path, partial: bool) -> None:
    if not partial:
        raise UserError(
            f"{path}: this run is missing; make it with `snakemake --cores 1 {path}`, or ask for --partial results"
        )
