"""Made-up studies whose verdicts are known beforehand."""

from functools import cache

import numpy as np
import pandas as pd

from mtcsirl.claims.claims import judge, load_criteria
from mtcsirl.results.rows import select
from mtcsirl.settings import Settings
from mtcsirl.study.design import design
from tests.results.made_up import evaluation, noise

SETTINGS = Settings()
TARGETS = {"velocity": 0.8, "action_norm": 3.0}
SAC = {"velocity": 0.32, "action_norm": 1.57}
CORRELATIONS = {"single_target": 0.1, "multi_task": 0.87}
"""Partial r of learned and true reward given r_task."""
SPREAD = 0.03
WITHOUT = "ablation_curriculum/constant"
"""The experiment of generators without the curriculum."""
CLAIMS = tuple(load_criteria()["claims"])


@cache
def _study(settings):
    return design(Settings.model_validate_json(settings))


def study(settings=SETTINGS):
    return _study(settings.model_dump_json())


def at(cs_reward, part, success=1.0):
    """Metrics of an agent that closes ``part`` of SAC's gap."""
    value = SAC[cs_reward] + part * (TARGETS[cs_reward] - SAC[cs_reward])
    return {**SAC, cs_reward: value, "success": success}


def as_the_paper_says(agent):
    """A study in which every claim holds."""
    if agent["stage"] == "train_sac":
        return SAC
    cs, experiment, method = agent["cs_reward"], agent["experiment"], agent["method"]
    if agent["stage"] in ("train_expert", "collect_demonstrations"):
        return at(cs, 0.99)
    if agent["stage"] == "learn_reward":
        return at(cs, 0.9, 0.5 if experiment == WITHOUT else 1.0)
    if experiment == "single_target":
        return at(cs, 0.03)
    if experiment == "multi_target":
        return at(cs, 0.85 if agent["source"] == agent["task"] else 0.05)
    if method.startswith("mt_csirl"):
        return at(cs, 0.85)
    return at(cs, 0.2, 0.7)


def changed(test, result):
    """As the paper says, except where ``test(agent)`` holds: there ``result(agent)``."""
    return lambda agent: result(agent) if test(agent) else as_the_paper_says(agent)


def scored(settings=SETTINGS):
    """The key of every reward that is scored, by IRL seed and evaluation task."""
    for cs in settings.cs_rewards:
        for seed in settings.irl_seeds:
            own = {"cs_reward": cs, "seed": seed}
            single = own | {"experiment": "single_target", "method": settings.single_target.method}
            for task in settings.single_target.tasks:
                yield single | {"source": task, "task": task}
            several = own | {"experiment": "multi_task", "method": "mt_csirl", "source": "all"}
            for task in settings.multi_task.unseen_tasks:
                yield several | {"task": task}


def scores(settings=SETTINGS):
    """r of each scored reward on two sets of transitions, and what a judge must not mistake for it."""
    own = {"transitions": "sac", "reward": "learned", "statistic": "pearson", "value": 0.3}
    others = {"transitions": "expert", "value": -0.5}, {"reward": "truth", "value": 1.0}, {"statistic": "epic"}
    return pd.DataFrame([key | own | other for key in scored(settings) for other in ({}, *others)])


def rewards(key, partial, generator, count):
    """(learned, truth, task reward) [count]: the truth rises as r_task falls, f has ``partial`` r with it given r_task.

    c = -0.4 t + 0.92 u and f = -0.1 t + p u + sqrt(1 - p^2) v with u and v independent of t: r_fc.t = p.
    """
    t, u, v = generator.normal(size=(3, count))
    return -0.1 * t + partial * u + np.sqrt(1 - partial**2) * v, -0.4 * t + np.sqrt(1 - 0.4**2) * u, t


def points(correlations=CORRELATIONS, settings=SETTINGS, spread=0.03, make=rewards):
    """Single transitions of every scored reward: 2 agents of SAC and experts, 2 generators, uniform actions.

    ``make(key, partial, generator, count)`` gives the rewards of one; ``spread``: of the partial r between IRL seeds.
    """
    frames = []
    agents = [(name, agent) for name in ("sac", "expert", "generator") for agent in (0, 1)] + [("uniform", 0)]
    sets = [(name, agent, episode) for name, agent in agents for episode in (0, 1)]
    labels = {
        name: np.repeat([one[i] for one in sets], 30) for i, name in enumerate(("transitions", "agent", "episode"))
    }
    for number, key in enumerate(scored(settings)):
        shift = spread * noise({"stage": "", "target": 0} | key, "r", "")
        f, c, t = make(key, correlations[key["experiment"]] + shift, np.random.default_rng(number), 30 * len(sets))
        frames.append(pd.DataFrame({**key, **labels, "learned": f, "truth": c, "task_reward": t}))
    return pd.concat(frames, ignore_index=True)


@cache
def usual_points(settings):
    """The same, made once for settings as JSON."""
    return points(settings=Settings.model_validate_json(settings))


def rows_of(means, spread=SPREAD, settings=SETTINGS):
    rows = evaluation(study(settings), means, spread)
    return rows[(rows["policy"] == "stochastic") & (rows["metric"] != "task_reward")].reset_index(drop=True)


def judge_all(
    means=as_the_paper_says,
    *,
    spread=SPREAD,
    settings=SETTINGS,
    transitions=None,
    change=lambda rows: rows,
    rescore=lambda frame: frame,
    names=None,
):
    """The findings on all claims or those called ``names``; ``change``, ``rescore`` may alter rows, scores last.

    ``transitions``: what ``points`` gives, unless the usual ones.
    """
    claims = {name: claim for name, claim in load_criteria()["claims"].items() if name in (names or CLAIMS)}
    rows = change(rows_of(means, spread, settings))
    if transitions is None and {"C4", "C9"} & set(claims):
        transitions = usual_points(settings.model_dump_json())
    criteria = load_criteria() | {"claims": claims}
    return judge(rows, rescore(scores(settings)), settings, points=transitions, criteria=criteria)


def finding(name, means=as_the_paper_says, **options):
    """The finding on one claim."""
    return judge_all(means, names=(name,), **options)[0]


def verdicts(means=as_the_paper_says, **options):
    """The verdict on each claim."""
    return {finding.name: finding.verdict for finding in judge_all(means, **options)}


def verdict(name, means=as_the_paper_says, **options):
    """Its verdict."""
    return finding(name, means, **options).verdict


def transfer(agent, experiment):
    return agent["stage"] == "transfer" and agent["experiment"] == experiment


def off_diagonal(agent):
    return transfer(agent, "multi_target") and agent["source"] != agent["task"]


def fail_gates(rows, **key):
    failed = rows.index.isin(select(rows, **key).index)
    return rows.assign(status=rows["status"].mask(failed, "below gate"))


def useless(rows, status, **key):
    gone = rows.index.isin(select(rows, **key).index)
    return rows.assign(value=rows["value"].mask(gone), status=rows["status"].mask(gone, status))


def missing(rows, **key):
    return useless(rows, "missing", **key)


def replicated(rows):
    """A study in which IRL seed k imitates the expert of seed k: rows of all experts' and demonstrations' seeds."""
    stages = ["train_expert", "collect_demonstrations"]
    kept = rows[~rows["stage"].isin(stages)]
    first = select(rows, stage=stages, seed=0)
    return pd.concat([kept, *(first.assign(seed=seed) for seed in SETTINGS.seeds)], ignore_index=True)
