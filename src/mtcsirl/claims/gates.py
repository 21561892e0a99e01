"""How many agents must have passed their gate, and which states say that one failed; one rule for all of them."""

import pandas as pd

from mtcsirl.results.rows import MISSING, OK, STALE


def failed(states: pd.Series) -> pd.Series:
    """Which agents failed, whatever those will do that are missing or stale."""
    return ~states.isin([OK, MISSING, STALE])


def needed(share: float, count: int) -> int:
    """Of ``count`` agents the whole number nearest to ``share`` of them."""
    return int(share * count + 0.5)
