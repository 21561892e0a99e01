"""How well learned rewards agree with the truth, over all seeds: one row per reward, transition set and statistic.

Statistics are those of :mod:`mtcsirl.results.correlation`. Rewards of different seeds differ in scale and offset,
which no correlation should see: the correlation of all seeds together is the mean of the seeds' own, weighted by their
transitions. Its interval is a cluster bootstrap that draws seeds, within them agents and within them whole episodes.
``gain`` is r(f) - r(-r_task): what f has over a reward that says nothing but the task. EPIC's interval is over seeds
alone (mean and t-interval).
"""

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from scipy.stats import rankdata

from mtcsirl.files import storage
from mtcsirl.results.correlation import Correlation, partial_correlation, pearson
from mtcsirl.results.points import read_points
from mtcsirl.results.statistics import Array, cluster_bootstrap, summarise, t_interval
from mtcsirl.study.runs import Score

KEY = ["experiment", "method", "cs_reward", "source", "task", "transitions"]
COLUMNS = (*KEY, "statistic", "value", "low", "high", "seeds", "agents", "episodes")


def gain(f: Array, c: Array, t: Array) -> float:
    """r(f, c) - r(-t, c): how much better f correlates with the truth than -r_task does."""
    return pearson(f, c) + pearson(t, c)


STATISTICS: dict[str, tuple[Correlation, tuple[str, ...], bool]] = {
    "pearson": (pearson, ("learned", "truth"), False),
    "spearman": (pearson, ("learned", "truth"), True),
    "partial": (partial_correlation, ("learned", "truth", "task_reward"), False),
    "gain": (gain, ("learned", "truth", "task_reward"), False),
    "pearson_residual": (pearson, ("learned_rest", "truth_rest"), False),
    "spearman_residual": (pearson, ("learned_rest", "truth_rest"), True),
}
"""Function of one seed's transitions, its columns of points.parquet, and whether they are ranked first; residual: task
reward and potential removed. Ranks are those within the seed, not within a resample of it."""
_NEEDED = ("transitions", "agent", "episode", "learned", "truth", "learned_rest", "truth_rest", "task_reward")


def read_quality(runs: Sequence[Score], results: Path | str, resamples: int) -> pd.DataFrame:
    """``reward_quality`` of the scored rewards of a study; no rows without runs.

    Raises:
        UserError: a file is missing or unreadable.
    """
    points, scores = [], []
    for run in runs:
        irl = run.irl
        key: dict[str, Any] = {
            "experiment": irl.experiment, "method": irl.method, "cs_reward": irl.cs_reward, "source": irl.source,
            "task": run.task, "seed": irl.seed,
        }  # fmt: skip
        folder = Path(results) / run.folder
        points.append(read_points(folder / "points.parquet", _NEEDED).assign(**key))
        needed = ("transitions", "reward", "statistic", "value")
        scores.append(storage.read_csv(folder / "scores.csv", needed).assign(**key))
    if not points:
        return pd.DataFrame({name: [] for name in COLUMNS})
    return reward_quality(pd.concat(points), pd.concat(scores), resamples)


def reward_quality(points: pd.DataFrame, scores: pd.DataFrame, resamples: int) -> pd.DataFrame:
    """Rows ``COLUMNS`` of single transitions and per-seed scores."""
    rows: list[dict[str, Any]] = []
    for key, group in points.groupby(KEY, sort=True):
        named = dict(zip(KEY, key, strict=True))
        group = group.sort_values("seed", kind="stable")
        clusters = [group[name].to_numpy() for name in ("seed", "agent", "episode")]
        counts = {
            "seeds": group["seed"].nunique(),
            "agents": len(group[["seed", "agent"]].drop_duplicates()),
            "episodes": len(group[["seed", "agent", "episode"]].drop_duplicates()),
        }
        for statistic, (measure, names, ranked) in STATISTICS.items():
            vectors = [_prepared(group[name].to_numpy(dtype=float), clusters[0], ranked) for name in names]
            found = cluster_bootstrap(
                _mean_over_seeds(measure, vectors, clusters[0]),
                clusters,
                np.random.default_rng(0),
                resamples=resamples,
            )
            rows.append(
                named | {"statistic": statistic, "value": found.value, "low": found.low, "high": found.high} | counts
            )
        epic = scores[(scores["reward"] == "learned") & (scores["statistic"] == "epic")]
        own = epic[(epic[KEY] == pd.Series(named)).all(axis=1)]["value"].dropna()
        low, high = t_interval(summarise(own)) if len(own) > 1 else (np.nan, np.nan)
        rows.append(named | {"statistic": "epic", "value": own.mean(), "low": low, "high": high} | counts)
    return pd.DataFrame(rows, columns=list(COLUMNS))


def _mean_over_seeds(measure: Correlation, vectors: Sequence[Array], seed: np.ndarray) -> Callable[[np.ndarray], float]:
    """The mean of a statistic of ``vectors`` [N] over the seeds in an index sorted by seed, weighted by transitions.

    NaN if one seed's is: a reward that says nothing beyond the task in one run has no mean over runs.
    """

    def statistic(index: np.ndarray) -> float:
        blocks = np.split(index, np.flatnonzero(np.diff(seed[index])) + 1)
        values = [measure(*(vector[block] for vector in vectors)) for block in blocks]
        return float(np.average(values, weights=[len(block) for block in blocks]))

    return statistic


def _prepared(values: Array, seed: np.ndarray, ranked: bool) -> Array:
    """The values, or their ranks within each seed."""
    if not ranked:
        return values
    out = np.empty_like(values)
    for one in np.unique(seed):
        out[seed == one] = rankdata(values[seed == one])
    return out


def quality_markdown(rows: pd.DataFrame, note: str = "") -> str:
    """A table with one line per reward and transition set, one column per statistic."""
    names = [*STATISTICS, "epic"]
    lines = [
        "Learned reward against the truth: correlation [95 % cluster-bootstrap interval over seeds, agents, episodes],",
        "before and after task reward and a linear potential were removed (residual). Partial: given the task reward.",
        "Gain: r less that of -r_task. EPIC distance [t-interval over seeds]: 0 the same, 0.71 unrelated, on pairs of",
        "states that no policy may ever see together. `across`: equal parts of all policies' transitions.",
        note,
        "",
        "| " + " | ".join((*KEY, "seeds", *names)) + " |",
        "|" + " --- |" * (len(KEY) + 1 + len(names)),
    ]
    for key, group in rows.groupby(KEY, sort=True):
        by_name = {row["statistic"]: row for row in group.to_dict("records")}
        texts = [f"{by_name[n]['value']:.2f} [{by_name[n]['low']:.2f}, {by_name[n]['high']:.2f}]" for n in names]
        named = (str(part) for part in (*key, group["seeds"].iloc[0]))
        lines.append("| " + " | ".join((*named, *texts)) + " |")
    if rows.empty:
        lines.append("\nNo reward was scored yet.")
    return "\n".join(lines) + "\n"
