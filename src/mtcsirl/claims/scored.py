"""C4 and C9: what the learned reward says of the true cs-reward, beyond what the task reward says already.

On plain SAC's transitions a reward that is nothing but -r_task correlates with the true velocity reward, since hands
that arrive stand still. The paper's r does not know that; the criteria look at the partial correlation given r_task,
across policies. r itself stands beside it, on every set of transitions, for the paper names none.
"""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pandas as pd

from mtcsirl.claims.evidence import Evidence, RewardSource, multi_task, single_target
from mtcsirl.claims.judging import (
    MET,
    NO_ESTIMATE,
    NOT_MET,
    UNCLEAR,
    Answer,
    Rules,
    Unit,
    tasks_of,
    three_way,
)
from mtcsirl.claims.preconditions import checked_runs
from mtcsirl.results.moments import Beyond, beyond_task
from mtcsirl.results.points import usable
from mtcsirl.results.published import NOT_PRINTED, in_paper_order
from mtcsirl.results.rows import select
from mtcsirl.results.statistics import Estimate, Interval, Summary, mean_correlation
from mtcsirl.results.straightened import within_tenths

PARTIAL = "partial r of learned and true reward given r_task"
"""The measure of the claims about correlations."""
NOTHING = Beyond(NO_ESTIMATE, NO_ESTIMATE, NO_ESTIMATE, 0, 0)


def correlation(evidence: Evidence, rules: Rules) -> Iterator[Unit]:
    """C4, C9: one unit per cs-reward and evaluation task, over all IRL seeds, agents and episodes."""
    settings = evidence.settings
    for cs in in_paper_order(settings.cs_rewards):
        for task in tasks_of(evidence, rules["units"]):
            if rules["experiment"] == "single_target":
                source = single_target(settings, cs, task)
            else:
                source = multi_task(settings, cs, "mt_csirl")
            points, left_out = usable(evidence.scored(source, task))
            unit = _unit(evidence, rules, source, task, points, left_out)
            yield checked_runs(evidence, unit, rules, source, unit.value.n)


def _unit(
    evidence: Evidence, rules: Rules, source: RewardSource, task: str, points: pd.DataFrame, left_out: tuple[str, ...]
) -> Unit:
    found = _found(points)
    rest = _found(within_tenths(points)).partial if len(points) else NO_ESTIMATE
    state, reason = _answer(found, rest, rules)
    # Figure 2c is about the first of the single tasks; Figures 3c and 7 do not say which unseen task they show.
    named = source.experiment == "multi_task" or task == evidence.settings.single_target.tasks[0]
    printed = evidence.published.correlation(source.experiment, source.cs_reward) if named else NOT_PRINTED
    limit = rules.get("at_most", rules.get("at_least"))
    return Unit(
        cs_reward=source.cs_reward,
        what=task,
        state=state,
        reason=reason,
        measure=PARTIAL,
        value=found.partial,
        holds=Interval(-limit, limit) if "at_most" in rules else Interval(limit, np.inf),
        ours=Summary(found.raw.value, np.nan, found.raw.n),
        interval=Interval(found.raw.low, found.raw.high),
        paper=printed,
        paper_value=printed.mean,
        notes=(*_notes(evidence.scores, source, task, found, rest), *left_out) if found.partial.n else left_out,
        folders=tuple(evidence.score_folders(source, task)),
    )


def _found(points: pd.DataFrame) -> Beyond:
    return beyond_task(points, np.random.default_rng(0)) if len(points) else NOTHING


def _answer(found: Beyond, rest: Estimate, rules: Rules) -> Answer:
    """The criterion's answer, unclear where ``rest``, r without any function of r_task, gives another."""
    ask = _small if "at_most" in rules else _large
    state, reason = ask(found, rules)
    bent, _ = ask(replace(found, partial=rest), rules)
    if state in (MET, NOT_MET) and bent != state:
        left = "nothing of one of the rewards is left" if np.isnan(rest.value) else f"r = {_text(rest)}"
        return UNCLEAR, f"{reason}, but {bent} within tenths of r_task, where {left}"
    return state, reason


def _small(found: Beyond, rules: Rules) -> Answer:
    """C4: the partial correlation is small and surely not large, and r is not large for another reason."""
    partial, raw, limit = found.partial, found.raw, rules["at_most"]
    if np.isnan(partial.value):
        return UNCLEAR, _nothing(found)
    small = abs(partial.value) <= limit and max(abs(partial.low), abs(partial.high)) <= rules["surely"]
    state, reason = three_way(small, partial.low > limit or partial.high < -limit, f"partial r at most {limit:g}")
    if state == MET and (raw.low > limit or raw.high < -limit):
        return UNCLEAR, f"r = {raw.value:.2f} across policies, but by r_task alone"
    return state, f"{reason}: {state}"


def _large(found: Beyond, rules: Rules) -> Answer:
    """C9: the partial correlation is large and surely not small, and r is surely larger than the control's."""
    partial, beyond, limit = found.partial, found.beyond, rules["at_least"]
    if np.isnan(partial.value):
        return UNCLEAR, _nothing(found)
    large = partial.value >= limit and partial.low >= rules["surely"]
    parts = [
        three_way(large, partial.high < limit, f"partial r at least {limit:g}"),
        three_way(beyond.low > 0, beyond.high < 0, "r larger than that of -r_task"),
    ]
    state = next((s for s in (NOT_MET, UNCLEAR) if any(s == answer for answer, _ in parts)), MET)
    return state, "; ".join(f"{about}: {answer}" for answer, about in parts)


def _nothing(found: Beyond) -> str:
    seeds = found.flat or found.nothing
    where = "" if len(seeds) == found.partial.n else f"IRL seed {', '.join(map(str, seeds))}: "
    if found.flat:
        return f"{where}the learned or the true reward does not vary"
    all_seeds = f"r = {found.raw.value:.2f}" + (" of all seeds" if where else "")
    return f"{where}{all_seeds} says nothing beyond r_task: the learned or the true reward is a function of it"


def _notes(scores: pd.DataFrame, source: RewardSource, task: str, found: Beyond, rest: Estimate) -> Iterator[str]:
    """r itself across policies and, as scored, on every set; the control; how many agents and episodes."""
    if not np.isnan(rest.value):
        yield f"within tenths of r_task r = {_text(rest)}"
    yield f"r across policies {_text(found.raw)}; minus r of the control -r_task {_text(found.beyond)}"
    if len(scores):
        own = select(scores, **source.key, task=task, reward="learned", statistic="pearson")
        sets = [(name, mean_correlation(group["value"])) for name, group in own.groupby("transitions")]
        if sets:
            yield "r by set: " + ", ".join(f"{name} {r.value:.2f}" for name, r in sets)
    yield f"{found.partial.n} IRL seeds, {found.agents} agents, {found.episodes} episodes"


def _text(estimate: Estimate) -> str:
    bounds = "" if np.isnan(estimate.low) else f" [{estimate.low:.2f}, {estimate.high:.2f}]"
    return f"{estimate.value:.2f}{bounds}"
