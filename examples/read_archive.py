"""Read the evidence archive with pandas alone: success of new agents, and one learned reward as NumPy arrays.

python examples/read_archive.py results/reference
"""

import sys
from pathlib import Path

import numpy as np
import pandas as pd

PART = "part-[0-9][0-9][0-9][0-9]"


def read(archive: Path, name: str) -> pd.DataFrame:
    """One frame over all parts; of a run that was added twice, the rows of the last part."""
    frames = [
        pd.read_parquet(path).assign(part=path.parent.name) for path in sorted(archive.glob(f"{PART}/{name}.parquet"))
    ]
    rows = pd.concat(frames, ignore_index=True)
    return rows[rows["part"] == rows.groupby("folder")["part"].transform("max")]


def weights(row: pd.Series) -> np.ndarray:
    """The numbers of a safetensors file: its words turned right by one bit, without the description before them."""
    exponents, rest = np.frombuffer(row["exponents"], "u1"), np.frombuffer(row["rest"], "u1").reshape(-1, 3)
    words = np.column_stack([rest, exponents]).view("<u4").ravel()
    content = (words >> np.uint32(1) | words << np.uint32(31)).tobytes()
    return np.frombuffer(content[8 + int.from_bytes(content[:8], "little") :], "<f4")


if __name__ == "__main__":
    archive = Path(sys.argv[1])
    rows = read(archive, "evaluation")
    agents = rows[rows["folder"].str.startswith("transfer/") & (rows["policy"] == "stochastic")]
    print(agents[agents["metric"] == "success"].groupby("folder")["value"].agg(["mean", "size"]))
    rewards = read(archive, "weights").query("file == 'reward.safetensors'")
    print(len(rewards), "learned rewards; the first has", len(weights(rewards.iloc[0])), "parameters")
