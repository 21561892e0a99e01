"""Made-up tidy frames with known answers, in the columns that the figures read."""

from itertools import product

import numpy as np
import pandas as pd

from mtcsirl.figures.data import FigureData
from mtcsirl.settings import Settings
from mtcsirl.study.design import design
from mtcsirl.study.runs import Baseline, Expert, IrlRun, Transfer

STEPS = np.arange(1_000, 40_001, 1_000)
TARGETS = {"velocity": 0.8, "action_norm": 3.0}
PLATEAUS = {"velocity": {"expert": 0.81, "irl": 0.78, "transfer": 0.70, "sac": 0.32}}
PLATEAUS["action_norm"] = {"expert": 2.95, "irl": 2.9, "transfer": 2.7, "sac": 1.6}
PLATEAUS["success"] = {"expert": 1.0, "irl": 0.9, "transfer": 0.5, "sac": 1.0}


def made_up_data(settings: Settings | None = None, *, noise: float = 0.04) -> FigureData:
    """Every run of the study: curves that rise to a plateau, points with a correlation near 0.9."""
    settings = settings or Settings()
    study = design(settings)
    generator = np.random.default_rng(0)
    curves = [frame for run in study for frame in _run_curves(run, generator, noise)]
    points = [_points(run.irl, generator) for run in study.scores]
    scores = [_score(frame) for frame in points]
    return FigureData(
        settings=settings, curves=pd.concat(curves), points=pd.concat(points), scores=pd.DataFrame(scores)
    )


def _run_curves(run, generator, noise):
    keys = {"stage": run.stage, "experiment": "", "method": "", "cs_reward": "", "source": "", "seed": None}
    metrics = ["velocity", "action_norm", "success"]
    if isinstance(run, Expert):
        members, kind, keys["cs_reward"] = [(run.task, run.target)], "expert", run.cs_reward
    elif isinstance(run, Baseline):
        members, kind = [(run.task, run.target)], "sac"
    elif isinstance(run, IrlRun | Transfer):
        irl = run if isinstance(run, IrlRun) else run.irl
        kind = "irl" if isinstance(run, IrlRun) else "transfer"
        members = run.members if isinstance(run, IrlRun) else [(run.task, run.target)]
        keys |= {name: getattr(irl, name) for name in ("experiment", "method", "cs_reward", "source")}
    else:
        return
    for (task, target), metric in product(members, metrics):
        top = PLATEAUS[metric][kind] * (1 + noise * generator.standard_normal())
        value = top * (1 - np.exp(-STEPS / 8_000)) + noise * generator.standard_normal(STEPS.size)
        yield pd.DataFrame(
            keys | {"seed": run.seed, "task": task, "target": target, "metric": metric, "step": STEPS, "value": value}
        )


def _points(irl, generator, transitions="sac", episodes=10, steps=100):
    count = episodes * steps
    truth = -np.abs(generator.gamma(3, 0.15, count))
    learned = 5 * (irl.seed + 1) * (truth + 0.1 * generator.standard_normal(count)) - 3
    keys = {name: getattr(irl, name) for name in ("experiment", "method", "cs_reward", "source", "seed")}
    return pd.DataFrame(
        keys
        | {
            "transitions": transitions,
            "episode": np.repeat(np.arange(episodes), steps),
            "truth": truth,
            "learned": learned,
            "task_reward": 1.0,
        }
    )


def _score(points):
    keys = ("experiment", "method", "cs_reward", "source", "seed", "transitions")
    r = float(np.corrcoef(points["truth"], points["learned"])[0, 1])
    row = points.iloc[0]
    return {name: row[name] for name in keys} | {
        "reward": "learned", "statistic": "pearson", "value": r, "low": r - 0.1, "high": r + 0.05, "n": len(points),
    }  # fmt: skip
