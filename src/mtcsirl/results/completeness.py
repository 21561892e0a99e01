"""Whether an agent's evaluation holds the episodes that its settings ask for."""

from collections.abc import Sequence
from itertools import product

import numpy as np
import pandas as pd

POLICIES = ("stochastic", "deterministic")


def what_lacks(rows: pd.DataFrame, names: Sequence[str], asked: int) -> str:
    """What the episodes of one agent lack of ``asked`` whole ones of each policy, each with the metrics ``names``.

    "" if nothing: every policy and metric has exactly the episodes 0 to ``asked`` - 1, and all values are finite.
    """
    needed = rows[rows["metric"].isin(names) & rows["policy"].isin(POLICIES)]
    cells = set(zip(needed["policy"], needed["metric"], needed["episode"], strict=True))
    wanted = set(product(POLICIES, names, range(asked)))
    if cells != wanted:
        policy, metric, _ = min(cells ^ wanted)
        found = sum(cell[:2] == (policy, metric) for cell in cells)
        return f"{policy} {metric}: {found} of {asked} episodes"
    broken = needed[~np.isfinite(needed["value"].to_numpy(dtype=float))]
    for policy, metric, episode in broken[["policy", "metric", "episode"]].itertuples(index=False):
        return f"{policy} {metric}: episode {int(episode)} has no number"
    return ""
