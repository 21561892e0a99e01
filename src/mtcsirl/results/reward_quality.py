"""How well learned rewards agree with the truth, over all seeds: one row per reward, transition set and statistic.

Statistics are those of :mod:`mtcsirl.results.correlation`. Rewards of different seeds differ in scale and offset,
which no correlation should see: per seed both rewards (for Spearman their ranks) are standardised, and the correlation
of all seeds together is then the mean of the seeds' own, weighted by their transitions. Its interval is a cluster
bootstrap that draws seeds and within them whole episodes. EPIC's is over seeds alone (mean and t-interval).
"""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from scipy.stats import rankdata

from mtcsirl.files import storage
from mtcsirl.results.correlation import pearson
from mtcsirl.results.statistics import Array, cluster_bootstrap, summarise, t_interval
from mtcsirl.study.runs import Score

KEY = ["experiment", "method", "cs_reward", "source", "task", "transitions"]
STATISTICS = {
    "pearson": ("learned", "truth", False),
    "spearman": ("learned", "truth", True),
    "pearson_residual": ("learned_rest", "truth_rest", False),
    "spearman_residual": ("learned_rest", "truth_rest", True),
}
"""Columns of points.parquet and whether to rank them; residual: task reward and potential removed."""


def read_quality(runs: Sequence[Score], results: Path | str, resamples: int) -> pd.DataFrame:
    """``reward_quality`` of the scored rewards of a study."""
    points, scores = [], []
    for run in runs:
        irl = run.irl
        key: dict[str, Any] = {
            "experiment": irl.experiment, "method": irl.method, "cs_reward": irl.cs_reward, "source": irl.source,
            "task": run.task, "seed": irl.seed,
        }  # fmt: skip
        folder = Path(results) / run.folder
        points.append(storage.read_parquet(folder / "points.parquet").assign(**key))
        scores.append(storage.read_csv(folder / "scores.csv").assign(**key))
    return reward_quality(pd.concat(points), pd.concat(scores), resamples)


def reward_quality(points: pd.DataFrame, scores: pd.DataFrame, resamples: int) -> pd.DataFrame:
    """Rows ``KEY``, statistic, value, low, high, seeds, episodes of single transitions and per-seed scores."""
    rows: list[dict[str, Any]] = []
    for key, group in points.groupby(KEY, sort=True):
        named = dict(zip(KEY, key, strict=True))
        seed, episode = group["seed"].to_numpy(), group["episode"].to_numpy()
        counts = {"seeds": len(np.unique(seed)), "episodes": len(group[["seed", "episode"]].drop_duplicates())}
        for statistic, (learned, truth, ranked) in STATISTICS.items():
            x, y = (_standardised(group[name].to_numpy(dtype=float), seed, ranked) for name in (learned, truth))
            found = cluster_bootstrap(
                lambda index, x=x, y=y: pearson(x[index], y[index]),  # type: ignore[misc]
                [seed, episode],
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
    return pd.DataFrame(rows)


def quality_markdown(rows: pd.DataFrame, note: str = "") -> str:
    """A table with one line per reward and transition set, one column per statistic."""
    names = [*STATISTICS, "epic"]
    lines = [
        "Learned reward against the truth: correlation [95 % cluster-bootstrap interval over seeds and episodes],",
        "before and after task reward and a linear potential were removed (residual); EPIC distance [t-interval over",
        "seeds]: 0 the same, 0.71 unrelated, on pairs of states that no policy may ever see together. `across`: all",
        "policies' transitions.",
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
    return "\n".join(lines) + "\n"


def _standardised(values: Array, seed: np.ndarray, ranked: bool) -> Array:
    """Values, or their ranks, with mean 0 and deviation 1 within each seed; 0 where a seed's do not vary."""
    out = np.zeros_like(values)
    for one in np.unique(seed):
        own = rankdata(values[seed == one]) if ranked else values[seed == one]
        spread = own.std()
        out[seed == one] = (own - own.mean()) / spread if spread > 0 else 0.0
    return out
