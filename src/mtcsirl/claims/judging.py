"""One judged unit of a claim, and the three-way answers that its state is put together from."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from mtcsirl.claims.evidence import Evidence, Group, Run, closer
from mtcsirl.results.published import UNKNOWN as NOT_PRINTED
from mtcsirl.results.statistics import (
    UNKNOWN,
    Estimate,
    Interval,
    Summary,
    Welch,
    hedges_g,
    prediction_interval,
    summarise,
    t_interval,
    welch,
)

MET, NOT_MET, UNCLEAR = "met", "not met", "unclear"
TOO_FEW, BLOCKED, NOT_RUN = "too few seeds", "precondition not met", "not run"
CORRELATION = "Pearson's r of learned and true reward"
"""The measure of the claims about correlations."""
NO_ESTIMATE = Estimate(np.nan, np.nan, np.nan, 0)
Rules = Mapping[str, Any]
Answer = tuple[str, str]
"""(met, not met or unclear; about what)."""


@dataclass(frozen=True, kw_only=True)
class Unit:
    """One judged cell of a claim, with every number that a reader may want to judge it by.

    ``measure``: what the criterion looks at, ``value`` with its 95 % interval; ``ours``: the metric itself over seeds;
    ``effect``: Hedges' g of ours against ``reference``, on the metric; ``difference``: Welch's test of the same;
    ``closer``: probability that one of our agents is closer to the target than one of the reference's; ``prediction``:
    where the paper's number says that ours should lie; ``paper_value``: ``measure`` of the paper's own numbers.
    """

    cs_reward: str
    what: str
    state: str
    reason: str
    measure: str
    value: Estimate
    ours: Summary
    interval: Interval = UNKNOWN
    success: Summary = NOT_PRINTED
    reference: str = ""
    reference_summary: Summary = NOT_PRINTED
    effect: Estimate = NO_ESTIMATE
    difference: Welch | None = None
    closer: float = np.nan
    paper: Summary = NOT_PRINTED
    prediction: Interval = UNKNOWN
    paper_value: float = np.nan

    @property
    def inside(self) -> bool | None:
        """Whether our mean lies in the paper's prediction interval; None where there is none."""
        known = np.isfinite(self.prediction.low) and np.isfinite(self.ours.mean)
        return self.prediction.contains(self.ours.mean) if known else None


def judged_unit(
    cs_reward: str,
    what: str,
    group: Group,
    answers: list[Answer],
    measure: str,
    value: Estimate,
    paper: Summary = NOT_PRINTED,
    paper_value: float = np.nan,
) -> Unit:
    """A unit whose state is the worst of its answers; its preconditions are yet to be checked."""
    ours = group.metric
    state = next((s for s in (NOT_MET, UNCLEAR) if any(s == answer for answer, _ in answers)), MET)
    return Unit(
        cs_reward=cs_reward,
        what=what,
        state=state,
        reason="; ".join(f"{about}: {answer}" for answer, about in answers),
        measure=measure,
        value=value,
        ours=ours,
        interval=t_interval(ours),
        success=group.success,
        paper=paper,
        prediction=prediction_interval(paper, ours.n) if paper.std > 0 else UNKNOWN,
        paper_value=paper_value,
    )


def against(unit: Unit, group: Group, reference: Group, name: str) -> Unit:
    """The unit with our agents compared to ``reference``."""
    base = reference.metric
    return replace(
        unit,
        reference=name,
        reference_summary=base,
        effect=hedges_g(unit.ours, base),
        difference=welch(unit.ours, base),
        closer=closer(group, reference),
    )


def checked(evidence: Evidence, unit: Unit, rules: Rules, run: Run | None, *groups: Group) -> Unit:
    """The unit, or why it cannot be judged: no results, failed experts or generators, no gap, too few seeds.

    The last of ``groups`` that is plain SAC is asked for room between it and the target.
    """
    seeds = [group.metric.n for group in groups]
    if min(seeds) == 0:
        return replace(unit, state=NOT_RUN, reason="no agent has been trained for this, or none is usable")
    for group in groups:
        if group.stage == "train_sac" and group.distance.mean < rules["room"] * group.target:
            return replace(unit, state=BLOCKED, reason="SAC alone is on target: there is no gap to close")
    if run is not None:
        seeds.append(len(set(evidence.settings.irl_seeds)))
    return checked_runs(evidence, unit, rules, run, min(seeds))


def checked_runs(evidence: Evidence, unit: Unit, rules: Rules, run: Run | None, seeds: int) -> Unit:
    """The unit, or why it cannot be judged, for units without agents: correlations."""
    if seeds == 0:
        return replace(unit, state=NOT_RUN, reason="no reward has been scored for this")
    why = evidence.blocked(run, rules["needs"], rules["gates"]) if run is not None else ""
    if why:
        return replace(unit, state=BLOCKED, reason=why)
    if seeds < rules["seeds"]:
        return replace(unit, state=TOO_FEW, reason=f"{seeds} of the {rules['seeds']} independent seeds a verdict needs")
    return unit


def three_way(holds: bool, refuted: bool, about: str) -> Answer:
    """Met if it holds, not met if it is refuted, else unclear."""
    return (NOT_MET if refuted else MET if holds else UNCLEAR), about


def at_least(summary: Summary, limit: float, about: str) -> Answer:
    """Met: the mean is at least ``limit``. Not met: the whole t-interval is below."""
    return three_way(summary.mean >= limit, t_interval(summary).high < limit, f"{about} at least {limit:g}")


def at_most(summary: Summary, limit: float, about: str) -> Answer:
    """Met: the mean is at most ``limit``. Not met: the whole t-interval is above."""
    return three_way(summary.mean <= limit, t_interval(summary).low > limit, f"{about} at most {limit:g}")


def advantage(test: Welch, needed: float, about: str) -> Answer:
    """Met: at least ``needed`` and surely more than 0. Not met: surely less than ``needed``."""
    return three_way(test.difference >= needed and test.low > 0, test.high < needed, about)


def closing(distance: Summary, sac: Summary, part: float) -> Answer:
    """Met: at least ``part`` of SAC's gap closed and surely closer than SAC. Not met: surely less than ``part``.

    d <= (1 - part) d_SAC is a contrast of two means, so that its interval carries the spread of SAC too.
    """
    contrast = welch(distance, scaled(sac, 1 - part))
    holds = contrast.difference <= 0 and welch(distance, sac).high < 0
    return three_way(holds, contrast.low > 0, f"closes at least {100 * part:g} % of SAC's gap")


def closed(group: Group, sac: Group) -> Estimate:
    """1 - d / d_SAC with the t-interval over our seeds, SAC's mean taken as known (the verdict does not)."""
    base = sac.distance.mean
    part = summarise(1 - group.distances.mean(axis=1, skipna=False).to_numpy(dtype=float) / base)
    return Estimate(part.mean, *t_interval(part), part.n)


def closed_in_paper(paper: float, sac: float, target: float) -> float:
    """1 - d / d_SAC of the paper's printed means."""
    return 1 - abs(paper - target) / abs(sac - target)


def judge_correlation(r: Estimate, rules: Rules) -> str:
    """``at_most``: |r| is small and surely not large; ``at_least``: r is large and surely not small."""
    if "at_most" in rules:
        small = abs(r.value) <= rules["at_most"] and max(abs(r.low), abs(r.high)) <= rules["surely"]
        state, _ = three_way(small, r.low > rules["at_most"] or r.high < -rules["at_most"], "")
    else:
        large = r.value >= rules["at_least"] and r.low >= rules["surely"]
        state, _ = three_way(large, r.high < rules["at_least"], "")
    return state


def scaled(summary: Summary, factor: float) -> Summary:
    """The summary of ``factor`` times the values."""
    return Summary(factor * summary.mean, abs(factor) * summary.std, summary.n)


def tasks_of(evidence: Evidence, units: str) -> tuple[str, ...]:
    """The tasks that a claim is judged on one by one."""
    settings = evidence.settings
    return {
        "single_target": settings.single_target.tasks,
        "unseen_tasks": settings.multi_task.unseen_tasks,
        "train_tasks": settings.multi_task.train_tasks,
    }[units]
