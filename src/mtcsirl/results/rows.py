"""All results of a study as tidy frames, with what is missing or doubtful marked in them.

``evaluation_rows`` has one row per agent, policy and metric: the mean over the agent's evaluation episodes, and a
status. No row is dropped: a run that the study asks for and that is not there stands in the frame with value NaN.
"""

from collections.abc import Iterator, Mapping
from itertools import product
from pathlib import Path
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np
import pandas as pd

from mtcsirl.errors import MissingError
from mtcsirl.files import storage
from mtcsirl.names import CS_REWARDS, DIVERGED, KEPT, LAST, distance_metric
from mtcsirl.results.agents import agents, run_key
from mtcsirl.results.completeness import POLICIES, what_lacks
from mtcsirl.results.gate_file import read_verdict
from mtcsirl.results.points import read_points
from mtcsirl.settings import Settings
from mtcsirl.study import standing as standings
from mtcsirl.study.runs import AnyRun, Baseline, Demonstrations, Expert, Runs
from mtcsirl.study.standing import DONE, standing

KEY = ("stage", "experiment", "method", "cs_reward", "source", "task", "target", "seed")
ROW_COLUMNS = (*KEY, "policy", "kept", "metric", "value", "episodes", "diverged", "status", "lacks", "folder")
CURVE_COLUMNS = (*KEY, "step", "metric", "value")
RUN_KEY = ("experiment", "method", "cs_reward", "source", "seed")
SCORE_COLUMNS = (*RUN_KEY, "transitions", "reward", "statistic", "value", "low", "high", "n")
POINT_COLUMNS = (*RUN_KEY, "transitions", "agent", "episode", "truth", "learned", "task_reward", "random")
EVALUATION_COLUMNS = ("task", "target", "seed", "policy", "kept", "episode", "metric", "value")

OK, BELOW_GATE, MISSING, DUPLICATED, FOREIGN, INCOMPLETE, STALE = (
    "ok", "below gate", "missing", "duplicated", "foreign", "incomplete", "stale"
)  # fmt: skip
"""Status of a run. Below gate: the agent did not learn what it had to; its value counts and is marked. Missing: no
evaluation. Duplicated: the numbers of another seed, or an episode twice. Foreign: the file names another task, target
or seed than its folder. Incomplete: not the episodes, policies and metrics that the settings ask for, or values
that are no numbers; ``lacks`` says which. Stale: made with other settings or code, or from other inputs. The last
five have the value NaN: nothing is averaged over the rest."""


def evaluation_rows(study: Runs, settings: Settings, *, partial: bool = False, kept: str = KEPT) -> pd.DataFrame:
    """Every agent of ``study`` with its evaluation, ``ROW_COLUMNS``; agents are run x member for IRL runs.

    ``settings``: the study's; a run that is not what they ask for is stale, whatever numbers it has. ``diverged``: in
    how many episodes the simulation diverged; they count as failed. ``kept``: the policy that each run leaves behind;
    see ``last_rows`` for the other.
    Demonstrations are rows too, of the stage ``collect_demonstrations`` with the seed of their expert: what their
    episodes reached and whether that passes the expert's gate.

    Raises:
        UserError: a run is missing or stale and ``partial`` is false; a file is unreadable.
    """
    found: list[dict[str, Any]] = []
    names, asked = metrics(study), settings.evaluation.episodes
    for run in study:
        if kept == LAST and not isinstance(run, Expert | Baseline):
            continue
        status, why = _standing(run, settings, partial)
        folder = Path(settings.results) / run.folder
        for agent in agents(run):
            evaluated = _Evaluated(status, why) if status else _evaluated(agent, folder, names, asked, kept)
            found += _agent_rows(agent, folder, names, kept, evaluated)
        if kept == KEPT and isinstance(run, Demonstrations):
            found += _demonstration_rows(run, folder, status, why)
    rows = pd.DataFrame(found, columns=list(ROW_COLUMNS))
    return _mark_equal_seeds(rows)


def last_rows(study: Runs, settings: Settings, *, partial: bool = False) -> pd.DataFrame:
    """``evaluation_rows`` of the last policies of experts and SAC, which keep their best; new agents keep their last.

    No gate is asked of them: their status is never "below gate".
    """
    return evaluation_rows(study, settings, partial=partial, kept=LAST)


def curve_rows(study: Runs, settings: Settings, *, partial: bool = False) -> pd.DataFrame:
    """The learning curves of all agents of ``study``, ``CURVE_COLUMNS``; missing and stale runs have no rows."""
    frames = []
    for run in study:
        path = Path(settings.results) / run.folder / "curve.csv"
        own_agents = list(agents(run))
        if not own_agents or _standing(run, settings, partial)[0]:
            continue
        curve = storage.read_csv(path, ("step", "metric", "value"))
        for agent in own_agents:
            own = curve
            if "task" in curve:
                own = curve[(curve["task"] == agent["task"]) & (curve["target"] == agent["target"])]
            frames.append(own[["step", "metric", "value"]].assign(**agent))
    return _joined(frames, CURVE_COLUMNS)


def score_rows(study: Runs, settings: Settings, *, partial: bool = False) -> pd.DataFrame:
    """Correlations of learned and true rewards, ``SCORE_COLUMNS`` + task; missing and stale runs have no rows."""
    return _of_scores(study, settings, "scores.csv", (*SCORE_COLUMNS, "task"), partial)


def point_rows(study: Runs, settings: Settings, *, partial: bool = False) -> pd.DataFrame:
    """Single transitions of those correlations, ``POINT_COLUMNS`` + task; missing and stale runs have no rows.

    Without the first of each episode (:mod:`mtcsirl.results.points`).
    """
    return _of_scores(study, settings, "points.parquet", (*POINT_COLUMNS, "task"), partial)


def _of_scores(study: Runs, settings: Settings, name: str, columns: tuple[str, ...], partial: bool) -> pd.DataFrame:
    read = read_points if name.endswith("parquet") else storage.read_csv
    own = (*RUN_KEY, "task")
    frames = []
    for run in study.scores:
        path = Path(settings.results) / run.folder / name
        if not _standing(run, settings, partial)[0]:
            key = {part: getattr(run.irl, part) for part in RUN_KEY} | {"task": run.task}
            frame = read(path, tuple(column for column in columns if column not in own))
            frames.append(frame.assign(**key))
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


def metrics(study: Runs) -> tuple[str, ...]:
    """What is read of an evaluation: success, mean and distance of cs-rewards, task reward.

    The cs-rewards are the paper's two and further ones of this study.
    """
    used = dict.fromkeys((*CS_REWARDS, *(x.cs_reward for x in study.experts), *(x.cs_reward for x in study.irl_runs)))
    return ("success", *used, *(distance_metric(name) for name in used), "task_reward")


class _Evaluated(NamedTuple):
    """What an agent's episodes say."""

    status: str
    lacks: str = ""
    episodes: Mapping[tuple[str, str], int] = MappingProxyType({})
    """By policy and metric, as the next one."""
    means: Mapping[tuple[str, str], float] = MappingProxyType({})
    """Of usable agents alone."""
    diverged: Mapping[str, int] = MappingProxyType({})
    """By policy."""


def _evaluated(agent: dict[str, Any], folder: Path, names: tuple[str, ...], asked: int, kept: str) -> _Evaluated:
    """The evaluation of one agent of the run in ``folder``."""
    path = folder / "evaluation.csv"
    if not path.is_file():
        return _Evaluated(MISSING)
    episodes = storage.read_csv(path, EVALUATION_COLUMNS)
    own = episodes[(episodes["task"] == agent["task"]) & (episodes["target"] == agent["target"])]
    chosen = own[own["kept"] == kept]
    lacks = what_lacks(chosen, (*names, DIVERGED), asked)
    status, lacks = _status(agent, own, lacks if len(own) or episodes.empty else "", folder, kept)
    groups = chosen.groupby(["policy", "metric"])["value"]
    sizes = groups.size().to_dict()
    if status not in (OK, BELOW_GATE):
        return _Evaluated(status, lacks, sizes)
    total = groups.sum()
    return _Evaluated(
        status, lacks, sizes, groups.mean().to_dict(), {policy: int(total[policy, DIVERGED]) for policy in POLICIES}
    )


def _agent_rows(
    agent: dict[str, Any], folder: Path, names: tuple[str, ...], kept: str, evaluated: _Evaluated
) -> Iterator[dict[str, Any]]:
    """One row per policy and metric of one agent."""
    marks = {"kept": kept, "status": evaluated.status, "lacks": evaluated.lacks, "folder": str(folder)}
    for policy, metric in product(POLICIES, names):
        yield (
            agent
            | marks
            | {
                "policy": policy,
                "metric": metric,
                "value": evaluated.means.get((policy, metric), np.nan),
                "episodes": evaluated.episodes.get((policy, metric), 0),
                "diverged": evaluated.diverged.get(policy, 0),
            }
        )


def _demonstration_rows(run: Demonstrations, folder: Path, status: str, why: str) -> Iterator[dict[str, Any]]:
    """Success and metric of one expert's demonstrations."""
    verdict: dict[str, Any] = {}
    if not status:
        verdict = read_verdict(folder / "gate.json")
        status = OK if verdict["passed"] else BELOW_GATE
    key = run_key(run) | {"task": run.task, "target": run.target, "seed": run.expert.seed}
    marks = {"policy": "stochastic", "kept": KEPT, "status": status, "lacks": why, "folder": str(folder)}
    counts = {"episodes": 0, "diverged": int(verdict.get("diverged", 0))}
    for metric, said in (("success", "success"), (run.cs_reward, "metric")):
        value = verdict.get(said)  # None, which is no number, is NaN
        yield key | marks | counts | {"metric": metric, "value": np.nan if value is None else float(value)}


def _status(agent: dict[str, Any], own: pd.DataFrame, lacks: str, folder: Path, kept: str) -> tuple[str, str]:
    """The status of an agent with its rows ``own``, of whatever policy, and what it lacks if it is incomplete."""
    if own.empty and not lacks:
        return FOREIGN, ""
    if (own["seed"] != agent["seed"]).any():
        return FOREIGN, ""
    if own.duplicated(["policy", "kept", "episode", "metric"]).any():
        return DUPLICATED, ""
    if lacks:
        return INCOMPLETE, lacks
    if kept != KEPT:
        return OK, ""
    gate = folder / "gate.json"
    if not gate.is_file():
        return INCOMPLETE, "gate.json"
    return (OK if _passed(gate, agent) else BELOW_GATE), ""


def _passed(gate: Path, agent: dict[str, Any]) -> bool:
    """Whether an agent passed, by the ``gate.json`` of its run.

    Raises:
        UserError: the file is no gate's.
    """
    verdict = read_verdict(gate)
    member = agent["task"], agent["target"]
    own = [one for one in verdict.get("members", []) if (one.get("task"), one.get("target")) == member]
    return bool((own or [verdict])[-1]["passed"])


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


def _standing(run: AnyRun, settings: Settings, partial: bool) -> tuple[str, str]:
    """MISSING or STALE and why, or nothing where the run is what the settings ask for.

    Raises:
        UserError: it is not, and ``partial`` is false.
    """
    found = standing(run, settings)
    if found.state == DONE:
        return "", ""
    stale = found.state == standings.STALE
    if not partial:
        state = "stale" if stale else "missing"
        why = f" ({found.why[0]})" if found.why else ""
        raise MissingError(f"{Path(settings.results) / run.folder}: this run is {state}{why}")
    return (STALE, found.why[0]) if stale else (MISSING, "; ".join(found.why))
