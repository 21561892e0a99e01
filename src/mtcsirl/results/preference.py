"""Does the reward that new agents are paid prefer what they do to what an expert does?

A new agent that loses its task was either trained too little to earn its reward or is paid for losing it. The first
could be mended by training, the second could not: here the expert of the agent's task, target and seed, plain SAC and
the agent itself act in the same world and are paid by the agent's own reward, r_task + lambda f. Where the agent earns
more than the expert, the learned reward asks for what the agent does.

Means over the steps of stochastic episodes: in the long run an agent with a discount maximises just that, less its
entropy's worth. ``paid_from_start`` is (1 - discount) sum of discount^t paid_t, in the same unit, from resets.
"""

from collections.abc import Hashable, Iterator, Sequence
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from mtcsirl.episodes.demonstrations import as_transitions, collect_demonstrations, demonstrated, whole_episodes
from mtcsirl.episodes.policy import load_policy
from mtcsirl.results.agents import run_key
from mtcsirl.results.statistics import summarise, t_interval
from mtcsirl.rewards.learned import LearnedReward, check_learned, load_learned_reward
from mtcsirl.settings import Settings
from mtcsirl.settings.runs import DemonstrationRunSettings
from mtcsirl.study.runs import Baseline, Expert, Transfer
from mtcsirl.transitions import Transitions

EPISODES = 4
NEW, EXPERT, SAC = BEHAVIOURS = ("new agent", "expert", "sac")
KEY = ("experiment", "method", "cs_reward", "source", "task", "target")
VALUES = ("r_task", "f", "paid", "paid_from_start", "success")
COLUMNS = (*KEY, "seed", "behaviour", *VALUES, "episodes")


def read_preferences(
    transfers: Sequence[Transfer], experts: Sequence[Expert], baselines: Sequence[Baseline], settings: Settings
) -> pd.DataFrame:
    """One row per new agent of ``transfers`` and behaviour, columns ``COLUMNS``.

    Each is beside the expert and the baseline of its task, target and seed; where there is none, there is no row.

    Raises:
        UserError: a policy or a reward is missing or damaged.
    """
    others: dict[tuple[str, str, int, int], Expert | Baseline] = {
        (run.cs_reward, run.task, run.target, run.seed): run for run in experts
    }
    others |= {(SAC, run.task, run.target, run.seed): run for run in baselines}
    acted = cache(lambda run: _acted(run, settings))  # an expert is paid by many rewards
    rows: list[dict[str, Any]] = []
    for run in transfers:
        place = (run.task, run.target, run.seed)
        behaviours = {NEW: run, EXPERT: others.get((run.irl.cs_reward, *place)), SAC: others.get((SAC, *place))}
        learned = _reward(run, settings)
        reward = {name: value for name, value in run_key(run).items() if name in KEY}
        key = reward | {"task": run.task, "target": run.target, "seed": run.seed}
        for behaviour, agent in behaviours.items():
            if agent is not None:
                # what a new agent did is asked for once and need not be kept
                frame = _acted(agent, settings) if agent is run else acted(agent)
                rows.append(key | {"behaviour": behaviour} | paid(frame, learned, run, settings))
    return pd.DataFrame(rows, columns=list(COLUMNS))


def _reward(run: Transfer, settings: Settings) -> LearnedReward:
    folder = Path(settings.results) / run.irl.folder
    learned = load_learned_reward(folder)
    check_learned(learned, folder, cs_reward=run.irl.cs_reward, observation=settings.environment.observation)
    return learned


def _acted(run: Expert | Baseline | Transfer, settings: Settings) -> pd.DataFrame:
    """Episodes of a run's policy on its own task and target."""
    policy = load_policy(Path(settings.results) / run.folder)
    steps = run.settings(settings).evaluation.episode_steps
    asked = DemonstrationRunSettings(environment=settings.environment, episodes=EPISODES, episode_steps=steps)
    return collect_demonstrations(policy, run.task, run.target, asked, seed=[run.seed, 4])


def paid(frame: pd.DataFrame, learned: LearnedReward, run: Transfer, settings: Settings) -> dict[str, float]:
    """What the new agent of ``run`` is paid for the transitions of ``frame``: ``VALUES``, and the number of episodes.

    r_task is the one that it learns on, which MT-CSIRL+LT may have learned as well; lambda f with the weight of its
    training. An episode that diverged counts as a failure, and its steps do not count.
    """
    whole = whole_episodes(frame)
    seen = as_transitions(whole, settings.environment.observation)
    own = run.settings(settings)
    r_task = seen.task_reward.numpy() if run.task_reward == "known" else _task_reward(learned, run, seen)
    f = own.cs_weight * learned(seen).numpy()
    step, discount = whole["step"].to_numpy(), own.sac.discount
    episodes = whole["episode"].nunique()
    from_start = float((1 - discount) * np.sum(discount**step * (r_task + f)) / episodes)
    means = {"r_task": float(r_task.mean()), "f": float(f.mean()), "paid": float((r_task + f).mean())}
    success = demonstrated(frame)["success"]
    return means | {"paid_from_start": from_start, "success": success, "episodes": episodes}


def _task_reward(learned: LearnedReward, run: Transfer, seen: Transitions) -> np.ndarray:
    return learned.task_reward(run.task, run.target)(seen).numpy()


def preferences(rows: pd.DataFrame) -> pd.DataFrame:
    """One row per reward and task: means over pairs, what new agents earn beyond the expert, and how many do.

    A pair is a new agent with the expert of its seed: agents without one do not count, in the means neither. ``n``:
    the pairs; ``n sac``: those with plain SAC beside them, over which its means are.
    ``beyond``: paid to the new agent less paid to the expert, mean with t-interval; ``prefers`` of ``n`` agents earn
    more than their expert, ``prefers_from_start`` do from resets.
    ``even_at``: at this part of lambda the two behaviours would earn the same; below it the one with more r_task earns
    more, if agents on that weight kept to these two, which they need not.
    """
    return pd.DataFrame(list(_preferred(rows)))


def _preferred(rows: pd.DataFrame) -> Iterator[dict[str, Any]]:
    for key, group in rows.groupby(list(KEY), sort=False):
        by = {str(name): own.set_index("seed") for name, own in group.groupby("behaviour")}
        if NEW not in by or EXPERT not in by:
            continue
        more = (by[NEW][list(VALUES)] - by[EXPERT][list(VALUES)]).dropna()
        if more.empty:
            continue
        by = {name: own[own.index.isin(more.index)] for name, own in by.items()}
        beyond, from_start = more["paid"], more["paid_from_start"]
        summary = summarise(beyond)
        low, high = t_interval(summary)
        named = dict(zip(KEY, key, strict=True))
        means = {f"{part} {name}": own[part].mean() for name, own in by.items() for part in VALUES}
        verdict = {"beyond": summary.mean, "low": low, "high": high, "prefers": int((beyond > 0).sum())}
        verdict["even_at"] = _even_at(*(by[name][["r_task", "f"]].mean() for name in (NEW, EXPERT)))
        counts = {"n": len(more), f"n {SAC}": len(by.get(SAC, ()))}
        yield named | means | verdict | {"prefers_from_start": int((from_start > 0).sum())} | counts


def _even_at(new: pd.Series, expert: pd.Series) -> float:
    """The part of lambda at which the two means earn the same; NaN where no weight above 0 does that."""
    task, f = expert["r_task"] - new["r_task"], new["f"] - expert["f"]
    return float(task / f) if task * f > 0 else np.nan


def preferences_markdown(rows: pd.DataFrame, note: str = "") -> str:
    """A table with one line per reward and task."""
    lines = [
        "What a new agent's reward, r_task + lambda f, pays a step to the agent, to the expert of its task, target",
        f"and seed, and to plain SAC: {EPISODES} stochastic episodes of each, mean over seeds. Beyond: new agent less",
        "expert [95 % t-interval over seeds]. Prefers: new agents that earn more than their expert, a step and",
        "discounted from resets; of agents that do as experts do, half. Where most do, the reward does not ask for",
        "what experts do. Even at: the part of lambda at which both would earn the same.",
        note,
        "",
    ]
    found = preferences(rows)
    if found.empty:
        return "\n".join([*lines, "No new agent has an expert to be held against yet."]) + "\n"
    head = (
        *KEY,
        "success",
        *(f"r_task, f: {name}" for name in BEHAVIOURS),
        "beyond",
        "prefers",
        "from resets",
        "even at",
    )
    lines += ["| " + " | ".join(head) + " |", "|" + " --- |" * len(head)]
    lines += ["| " + " | ".join(_cells(row)) + " |" for row in found.to_dict("records")]
    return "\n".join(lines) + "\n"


def _cells(row: dict[Hashable, Any]) -> Iterator[str]:
    yield from (str(row[name]) for name in KEY)
    yield f"{row[f'success {NEW}']:.2f}"
    for name in BEHAVIOURS:
        pays = row.get(f"f {name}", np.nan)
        few = name == SAC and row[f"n {SAC}"] < row["n"]
        count = f" (n = {row[f'n {SAC}']})" if few else ""
        yield "" if np.isnan(pays) else f"{row[f'r_task {name}']:.1f}, {pays:.1f}{count}"
    interval = f" [{row['low']:.1f}, {row['high']:.1f}]" if row["n"] > 1 else ""
    yield f"{row['beyond']:.1f}{interval}"
    yield from (f"{row[name]} of {row['n']}" for name in ("prefers", "prefers_from_start"))
    yield "" if np.isnan(row["even_at"]) else f"{row['even_at']:.2f}"
