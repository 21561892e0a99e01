"""What the benchmarks share: a turn in CPU seconds, a row from the turns of both sides, a command line."""

import argparse
import json
import subprocess
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from statistics import median, quantiles
from time import thread_time
from typing import Any

import numpy as np
import torch

Row = dict[str, Any]
FOLDER = Path(__file__).parent
_WIDTHS = (20, 42, 12, 12, 8, 14, 8)


def seconds(call: Callable[[], Any], count: int = 1) -> float:
    """CPU seconds of this thread for one call, the mean of ``count``."""
    started = thread_time()
    for _ in range(count):
        call()
    return (thread_time() - started) / count


def peer(name: str) -> Path:
    """The interpreter of a peer's environment; it exists once peer_environment.sh has made it."""
    return FOLDER.parent / "build" / name / "bin/python"


@contextmanager
def served(name: str, script: str, *arguments: str) -> Iterator[Callable[[int], float]]:
    """A script of this folder in the environment of a peer; one call is one turn there, in CPU seconds."""
    command = [str(peer(name)), "-W", "ignore", str(FOLDER / script), *arguments]
    pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE, "stderr": subprocess.DEVNULL}
    with subprocess.Popen(command, text=True, **pipes) as process:  # type: ignore[call-overload]

        def turn(count: int = 1) -> float:
            process.stdin.write(f"{count}\n")
            process.stdin.flush()
            return float(json.loads(process.stdout.readline()))

        yield turn
        process.stdin.close()


def row(benchmark: str, setting: str, against: str, times: Iterable[Iterable[float]], work: float = 1.0) -> Row:
    """A row {benchmark, setting, ours, theirs, peer, ratio, ratio_low, ratio_high} from (ours, theirs) of every round.

    ours and theirs: ``work`` per second of the median turn. The ratio is the median of the rounds' ratios; ratio_low
    and ratio_high are its quartiles over rounds.
    """
    turns = np.array([list(both) for both in times])
    ratios = list(turns[:, 1] / turns[:, 0])
    low, _, high = quantiles(ratios, n=4)
    ours, theirs = (float(work / value) for value in np.median(turns, axis=0))
    return {
        "benchmark": benchmark,
        "setting": setting,
        "ours": ours,
        "theirs": theirs,
        "peer": against,
        "ratio": median(ratios),
        "ratio_low": low,
        "ratio_high": high,
    }


def print_rows(rows: Iterable[Row]) -> list[Row]:
    """Print every row as it comes; returns them all."""
    _print("benchmark", "setting", "ours", "theirs", "ratio", "quartiles", "GEMM")
    found = []
    for one in rows:
        found.append(one)
        quartiles = f"{one['ratio_low']:.2f} to {one['ratio_high']:.2f}"
        share = f"{one['gemm_share']:.0%}" if "gemm_share" in one else ""
        numbers = (f"{one[name]:.4g}" for name in ("ours", "theirs", "ratio"))
        _print(one["benchmark"], one["setting"], *numbers, quartiles, share)
    return found


def _print(*cells: str) -> None:
    print("  ".join(cell.ljust(width) for cell, width in zip(cells, _WIDTHS, strict=True)).rstrip(), flush=True)


def command(text: str | None, measure: Callable[[int], Iterable[Row]], profile: Callable[[], None] | None) -> None:
    """The command line of one benchmark: the table, on request the profile."""
    parser = argparse.ArgumentParser(description=text, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--rounds", type=int, default=5, help="turns of each side (default 5)")
    if profile is not None:
        parser.add_argument("--profile", action="store_true", help="show where the time of our side goes")
    arguments = parser.parse_args()
    torch.set_num_threads(1)
    print_rows(measure(arguments.rounds))
    if profile is not None and arguments.profile:
        profile()
