"""Made-up studies whose verdicts are known beforehand."""

from functools import cache

import pandas as pd

from mtcsirl.claims.claims import judge, load_criteria
from mtcsirl.results.rows import KEY, select
from mtcsirl.settings import Settings
from mtcsirl.study.design import design
from tests.results.made_up import evaluation, noise

SETTINGS = Settings()
TARGETS = {"velocity": 0.8, "action_norm": 3.0}
SAC = {"velocity": 0.32, "action_norm": 1.57}
CORRELATIONS = {"single_target": 0.18, "multi_task": 0.87}
SPREAD = 0.03
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
        return at(cs, 0.9, 0.5 if experiment == "ablation_curriculum" else 1.0)
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


def with_ablation(rows, means, spread=SPREAD):
    """Rows with the generators of the ablation without the curriculum beside them."""
    ablations = SETTINGS.ablations
    own = select(rows, experiment="single_target", stage="learn_reward", source=ablations.tasks)
    own = select(own, cs_reward=ablations.cs_reward).assign(experiment="ablation_curriculum")
    keys = own[list(KEY)].to_dict("records")
    jitter = [noise(key, "success", "") for key in keys]
    success = [means(key)["success"] * (1 + spread * x) for key, x in zip(keys, jitter, strict=True)]
    own = own.assign(value=own["value"].where(own["metric"] != "success", success))
    return pd.concat([rows, own], ignore_index=True)


def scores(correlations=CORRELATIONS, settings=SETTINGS, spread=0.05):
    rows = []
    for run in study(settings).scores:
        key = {name: getattr(run.irl, name) for name in ("experiment", "method", "cs_reward", "source", "seed")}
        jitter = spread * noise(key | {"stage": "", "task": "", "target": 0}, "r", "")
        value = correlations[run.irl.experiment] + jitter
        rows.append(key | {"transitions": "sac", "reward": "learned", "statistic": "pearson", "value": value})
        rows.append(key | {"transitions": "expert", "reward": "learned", "statistic": "pearson", "value": -0.5})
        rows.append(key | {"transitions": "sac", "reward": "truth", "statistic": "pearson", "value": 1.0})
    return pd.DataFrame(rows)


def rows_of(means, spread=SPREAD, settings=SETTINGS):
    rows = with_ablation(evaluation(study(settings), means, spread), means, spread)
    return rows[(rows["policy"] == "stochastic") & (rows["metric"] != "task_reward")].reset_index(drop=True)


def judge_all(
    means=as_the_paper_says,
    *,
    spread=SPREAD,
    settings=SETTINGS,
    correlations=CORRELATIONS,
    change=lambda rows: rows,
    rescore=lambda frame: frame,
    names=None,
):
    """The findings on all claims or those called ``names``; ``change``, ``rescore`` may alter rows, scores last."""
    claims = {name: claim for name, claim in load_criteria()["claims"].items() if name in (names or CLAIMS)}
    rows = change(rows_of(means, spread, settings))
    return judge(rows, rescore(scores(correlations, settings)), settings, load_criteria() | {"claims": claims})


def finding(name, means=as_the_paper_says, **options):
    """The finding on one claim."""
    return judge_all(means, names=(name,), **options)[0]


def verdicts(means=as_the_paper_says, **options):
    """The verdict on each claim."""
    return {finding.name: finding.verdict for finding in judge_all(means, **options)}


def verdict(name, means=as_the_paper_says, **options):
    """Its verdict."""
    return finding(name, means, **options).verdict
