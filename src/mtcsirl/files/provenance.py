"""Where a run came from and what it cost: ``provenance.json``."""

import functools
import importlib.metadata
import os
import platform
import resource
import subprocess
import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from mtcsirl.files.storage import checksum, write_json
from mtcsirl.names import KERNELS

PACKAGES = ("metaworld", "mujoco", "gymnasium", "torch", "numpy", "stable-baselines3", "snakemake")


@functools.cache
def commit() -> str:
    """Git commit of the code, "+" appended if the working tree differs; else "unknown: " and why."""
    folder = Path(__file__).resolve().parent

    def git(*words: str) -> str:
        return subprocess.run(["git", *words], cwd=folder, capture_output=True, text=True, check=True).stdout.strip()

    try:
        return git("rev-parse", "HEAD") + ("+" if git("status", "--porcelain", "--untracked-files=no") else "")
    except OSError:
        return "unknown: git is not there"
    except subprocess.CalledProcessError as error:
        if "dubious ownership" in error.stderr:
            return f"unknown: a checkout of another user; git config --global --add safe.directory {folder.parents[2]}"
        return "unknown: no git checkout"


def machine() -> dict[str, Any]:
    """Processor, cores, the kernels that numpy's OpenBLAS or all libraries were asked for, and operating system."""
    model = platform.processor()
    cpuinfo = Path("/proc/cpuinfo")
    if cpuinfo.is_file():
        names = [
            line.split(":", 1)[1].strip() for line in cpuinfo.read_text().splitlines() if line.startswith("model name")
        ]
        model = names[0] if names else model
    return {
        "processor": model,
        "cores": os.cpu_count(),
        "openblas": os.environ.get("OPENBLAS_CORETYPE", "its own choice"),
        "system": platform.platform(),
        "python": platform.python_version(),
        **({"kernels": os.environ[KERNELS]} if os.environ.get(KERNELS) else {}),
    }


def _versions() -> dict[str, str]:
    found = {}
    for name in PACKAGES:
        try:
            found[name] = importlib.metadata.version(name)
        except importlib.metadata.PackageNotFoundError:
            continue
    return found


class Stopwatch:
    """Wall seconds, CPU seconds and peak memory of a run: since it was made, and of the tries before."""

    def __init__(self) -> None:
        self._wall = time.monotonic()
        self._cpu = time.process_time()
        self._before = {"wall_seconds": 0.0, "cpu_seconds": 0.0, "peak_memory_mib": 0.0}

    def add(self, spent: Mapping[str, float]) -> None:
        """Count what `read` gave an earlier try; a checkpoint carries it to the next."""
        for name in ("wall_seconds", "cpu_seconds"):
            self._before[name] += spent[name]
        self._before["peak_memory_mib"] = max(self._before["peak_memory_mib"], spent["peak_memory_mib"])

    def read(self, agents: int = 1) -> dict[str, float]:
        """The cost so far, earlier tries included; time is shared by ``agents`` runs."""
        peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
        return {
            "wall_seconds": round((self._before["wall_seconds"] + time.monotonic() - self._wall) / agents, 3),
            "cpu_seconds": round((self._before["cpu_seconds"] + time.process_time() - self._cpu) / agents, 3),
            "peak_memory_mib": round(max(peak, self._before["peak_memory_mib"]), 1),
        }


def write_provenance(
    folder: Path | str,
    stopwatch: Stopwatch,
    inputs: Mapping[str, Path] | None = None,
    *,
    agents: int = 1,
    lockstep: Sequence[str] = (),
) -> None:
    """Write ``provenance.json`` into a run folder: commit, versions, machine, cost, checksums of the inputs.

    ``agents``: how many runs the process made at once; each bears its share of the time. ``lockstep``: which they were.
    """
    write_json(
        Path(folder) / "provenance.json",
        {
            "commit": commit(),
            "versions": _versions(),
            "machine": machine(),
            "cost": stopwatch.read(agents),
            "lockstep": list(lockstep) if len(lockstep) > 1 else [],
            "inputs": {name: checksum(path) for name, path in sorted((inputs or {}).items())},
        },
    )
