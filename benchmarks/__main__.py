"""All benchmarks: measure, print a table, write results.json and a plot.

make bench                      about ten minutes on a machine that has nothing else to do
python -m benchmarks --rounds 3 faster and noisier
"""

import argparse
import os
import re
from pathlib import Path
from typing import Any

os.environ.setdefault("OMP_NUM_THREADS", "1")

import matplotlib
import torch
from matplotlib.figure import Figure

from benchmarks import agent_steps, environment_steps, irl_steps, jobs, sac_updates
from benchmarks.sides import print_rows
from mtcsirl.files.provenance import commit, machine
from mtcsirl.files.storage import atomic, write_json

FOLDER = Path(__file__).parent


def main() -> None:
    """Run every benchmark in one thread."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--rounds", type=int, default=7, help="turns of each side (default 7)")
    rounds = parser.parse_args().rounds
    torch.set_num_threads(1)
    modules = (sac_updates, environment_steps, agent_steps, irl_steps, jobs)
    rows = print_rows(row for module in modules for row in module.measure(rounds))
    write_json(FOLDER / "results.json", {"commit": commit(), "machine": machine(), "rows": rows})
    with atomic(FOLDER / "results.png", "wb") as handle:
        plot(rows).savefig(handle, format="png", dpi=150)


def plot(rows: list[dict[str, Any]]) -> Figure:
    """Ratio to the peer, one bar each; resets, some 60 times faster, are in the table only. 1 is the peer itself."""
    matplotlib.use("Agg")
    rows = [row for row in rows if row["benchmark"] != "environment_resets"]
    figure = Figure(figsize=(8.5, 0.8 + 0.24 * len(rows)), layout="constrained")
    axes = figure.add_subplot()
    labels = [
        f"{row['benchmark']}: {row['setting']}, against {re.split(r' [0-9]| of ', row['peer'])[0]}" for row in rows
    ]
    axes.barh(range(len(rows)), [row["ratio"] for row in rows], color="#0072B2")
    axes.set_yticks(range(len(rows)), labels, fontsize=7)
    axes.invert_yaxis()
    axes.axvline(1.0, color="black", linewidth=1)
    axes.set_xlabel("speed relative to the peer")
    return figure


if __name__ == "__main__":
    main()
