"""Which agents a run evaluates, and the key of each in tidy frames."""

from collections.abc import Iterator
from typing import Any

from mtcsirl.study.runs import AnyRun, Baseline, Expert, IrlRun, Transfer


def agents(run: AnyRun) -> Iterator[dict[str, Any]]:
    """The key of each agent that ``run`` evaluates."""
    key = run_key(run)
    if isinstance(run, IrlRun):
        for task, target in run.members:
            yield key | {"task": task, "target": target, "seed": run.seed}
    elif isinstance(run, Expert | Baseline | Transfer):
        yield key | {"task": run.task, "target": run.target, "seed": run.seed}


def run_key(run: AnyRun) -> dict[str, Any]:
    """The part of the key that all agents of ``run`` share; a variant's experiment is its name, as ``ablation_x/y``."""
    irl = run.irl if isinstance(run, Transfer) else run if isinstance(run, IrlRun) else None
    return {
        "stage": run.stage,
        "experiment": (run.key["variant"].removeprefix("ablations/").rstrip("/") or irl.experiment) if irl else "",
        "method": irl.method if irl else "",
        "cs_reward": irl.cs_reward if irl else getattr(run, "cs_reward", ""),
        "source": irl.source if irl else "",
    }
