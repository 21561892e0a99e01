"""How many agents must have passed their gate, and which states say that one failed; one rule for all of them."""

import pandas as pd

from mtcsirl.results.rows import BELOW_GATE, MISSING, OK, STALE


def failed(states: pd.Series) -> pd.Series:
    """Which agents failed, whatever those will do that are missing, or that have no evaluation that counts."""
    return states == BELOW_GATE


def unusable(states: pd.Series) -> pd.Series:
    """Which agents have an evaluation that says nothing of them: damaged, copied or another's."""
    return ~states.isin([OK, BELOW_GATE, MISSING, STALE])


def needed(share: float, count: int) -> int:
    """Of ``count`` agents the whole number nearest to ``share`` of them."""
    return int(share * count + 0.5)
