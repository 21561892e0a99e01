"""One judged unit of a claim, and the three-way answers that its state is put together from."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from mtcsirl.claims.evidence import Evidence, Group, RewardSource, closer
from mtcsirl.results.contrasts import SpreadRatio, fieller, spread_ratio
from mtcsirl.results.published import NOT_PRINTED
from mtcsirl.results.statistics import (
    ONE_SIDED,
    UNKNOWN_INTERVAL,
    Estimate,
    Interval,
    Summary,
    Welch,
    contrast,
    hedges_g,
    prediction_interval,
    t_interval,
    welch,
)

MET, NOT_MET, UNCLEAR = "met", "not met", "unclear"
TOO_FEW, BLOCKED, NOT_RUN = "too few seeds", "precondition not met", "not run"
SHOWN = "not judged"
"""A unit that stands beside the judged ones for comparison."""
LIKE_SAC, TRANSFERS, RUINED, FARTHER = "like SAC", "behaviour transfers", "agent ruined", "farther than SAC"
NO_GAP = "no gap to close"
UNDECIDED = "undecided"
"""What became of new agents where the claim is that nothing does."""
NO_ESTIMATE = Estimate(np.nan, np.nan, np.nan, 0)
CONDITIONAL = "conditional on the experts: all IRL seeds imitate those of the first seed"
Rules = Mapping[str, Any]
Answer = tuple[str, str]
"""(met, not met or unclear; about what)."""


@dataclass(frozen=True, kw_only=True)
class Unit:
    """One judged cell of a claim, with every number that a reader may want to judge it by.

    ``measure``: what the criterion looks at, ``value`` with its 95 % interval, ``holds``: where on its scale the
    criterion holds; ``outcome``: what became of the agents, where that has names; ``ours``: the metric itself over
    seeds; ``effect``: Hedges' g of ours against ``reference``, on the metric; ``difference``: Welch's test of the same;
    ``closer``: probability that one of our agents is closer to the target than one of the reference's; ``prediction``:
    where the paper's number says that ours should lie; ``paper_value``: ``measure`` of the paper's own numbers;
    ``power``: of an equivalence test at these spreads and seeds; ``notes``: what else a reader should know.
    """

    cs_reward: str
    what: str
    state: str
    reason: str
    measure: str
    value: Estimate
    ours: Summary
    holds: Interval = UNKNOWN_INTERVAL
    outcome: str = ""
    interval: Interval = UNKNOWN_INTERVAL
    success: Summary = NOT_PRINTED
    reference: str = ""
    reference_summary: Summary = NOT_PRINTED
    effect: Estimate = NO_ESTIMATE
    difference: Welch | None = None
    closer: float = np.nan
    paper: Summary = NOT_PRINTED
    prediction: Interval = UNKNOWN_INTERVAL
    paper_value: float = np.nan
    power: float = np.nan
    notes: tuple[str, ...] = ()
    folders: tuple[str, ...] = ()
    """Of the runs that were looked at, below the results."""

    @property
    def inside(self) -> bool | None:
        """Whether our mean lies in the paper's prediction interval; None where there is none."""
        known = np.isfinite(self.prediction.low) and np.isfinite(self.ours.mean)
        return self.prediction.contains(self.ours.mean) if known else None

    @property
    def spreads(self) -> SpreadRatio:
        """The paper's spread against ours; extreme: its +- is not over the same seeds, "inside" then says nothing."""
        return spread_ratio(self.paper, self.ours)


def judged_unit(
    cs_reward: str,
    what: str,
    group: Group,
    answers: Sequence[Answer],
    measure: str,
    value: Estimate,
    paper: Summary = NOT_PRINTED,
    **more: Any,
) -> Unit:
    """A unit whose state is the worst of its answers; its preconditions are yet to be checked."""
    ours = group.metric
    return Unit(
        cs_reward=cs_reward,
        what=what,
        state=worst(answers),
        reason="; ".join(f"{about}: {answer}" for answer, about in answers),
        measure=measure,
        value=value,
        ours=ours,
        interval=t_interval(ours),
        success=group.success,
        paper=paper,
        prediction=prediction_interval(paper, ours.n) if paper.std > 0 else UNKNOWN_INTERVAL,
        notes=tuple(group_notes(group)),
        **more,
    )


def group_notes(group: Group) -> Iterator[str]:
    """What the metric over whole episodes does not show of ``group``."""
    steps = group.step_distance
    if steps.n:
        spread = "" if np.isnan(steps.std) else f"±{steps.std:.2f}"
        yield f"E|m - tau| of single steps {steps.mean:.2f}{spread}; |E m - tau| {group.distance.mean:.2f}"
    if group.last is not None:
        yield f"kept policies; the last ones: {group.last.metric.mean:.2f}, here {group.metric.mean:.2f}"


def against(unit: Unit, group: Group, reference: Group, name: str) -> Unit:
    """The unit with our agents compared to ``reference``."""
    base = reference.metric
    kept = [f"{name}: {note}" for note in group_notes(reference) if note.startswith("kept")]
    return replace(
        unit,
        reference=name,
        reference_summary=base,
        effect=hedges_g(unit.ours, base),
        difference=welch(unit.ours, base),
        closer=closer(group, reference),
        notes=(*unit.notes, *kept),
    )


def checked(
    evidence: Evidence, unit: Unit, rules: Rules, source: RewardSource | None, *groups: Group, pairs: int | None = None
) -> Unit:
    """The unit, or why it cannot be judged: no results, failed experts or generators, no gap, too few seeds.

    Every one of ``groups`` that is plain SAC is asked for room between it and the target; ``pairs``: seeds of which
    both agents are there, where they are compared seed by seed.
    """
    results = Path(evidence.settings.results)
    folders = sorted(
        Path(folder).relative_to(results).as_posix() for folder in {one for group in groups for one in group.folders}
    )
    unit = replace(unit, folders=tuple(folders))
    seeds = [group.metric.n for group in groups] + ([] if pairs is None else [pairs])
    if min(seeds) == 0:
        return unjudged(unit, NOT_RUN, "no agent has been trained for this, or none is usable")
    for group in groups:
        # few seeds of SAC do not show that it is on target
        if group.stage == "train_sac" and group.metric.n >= rules["seeds"] and no_gap(group, rules):
            return unjudged(unit, BLOCKED, "SAC alone is on target: there is no gap to close")
    if source is not None:
        seeds.append(len(set(evidence.settings.irl_seeds)))
    return checked_runs(evidence, unit, rules, source, min(seeds))


def no_gap(sac: Group, rules: Rules) -> bool:
    """Whether plain SAC is so near to the target that nothing can be seen to close its gap."""
    return bool(sac.distance.mean < rules["room"] * sac.target)


def unjudged(unit: Unit, state: str, reason: str) -> Unit:
    """The unit with the reason why it is not judged; nothing is said of what became of its agents."""
    return replace(unit, state=state, outcome="", reason=reason)


def checked_runs(evidence: Evidence, unit: Unit, rules: Rules, source: RewardSource | None, seeds: int) -> Unit:
    """The unit, or why it cannot be judged, for units without agents: correlations."""
    if seeds == 0:
        return unjudged(unit, NOT_RUN, "no reward has been scored for this")
    if source is not None:
        why, failed = evidence.blocked(source, rules["needs"], rules["gates"])
        if why:
            return unjudged(unit, BLOCKED if failed else NOT_RUN, why)
        if source.one_expert:
            unit = replace(unit, notes=(*unit.notes, CONDITIONAL))
    if seeds < rules["seeds"]:
        return unjudged(unit, TOO_FEW, f"{seeds} of the {rules['seeds']} independent seeds a verdict needs")
    return unit


def works_at_home(unit: Unit, own: Group, sac: Group, needed: float) -> Unit:
    """The unit, unless its reward fails on its own task too: then transfer is not what fails elsewhere."""
    answer, _ = closing(own.distance, sac.distance, needed)
    if unit.state in (MET, NOT_MET, UNCLEAR) and answer == NOT_MET:
        return unjudged(unit, BLOCKED, "its reward does not transfer to its own task either")
    if unit.state == MET and answer == UNCLEAR:
        return replace(unit, state=UNCLEAR, reason=f"{unit.reason}; transfers to its own task: {UNCLEAR}")
    return unit


def worst(answers: Sequence[Answer]) -> str:
    """Not met if one answer is, else unclear if one is."""
    return next((state for state in (NOT_MET, UNCLEAR) if any(answer == state for answer, _ in answers)), MET)


def three_way(holds: bool, refuted: bool, about: str) -> Answer:
    """Met if it holds, not met if it is refuted, else unclear."""
    return (NOT_MET if refuted else MET if holds else UNCLEAR), about


def surely(about: str, *terms: tuple[float, Summary], constant: float = 0.0) -> Answer:
    """Met if the contrast (see ``statistics.contrast``) is at least 0, not met if it is below, each surely.

    Surely: by its one-sided 95 % bound.
    """
    test = contrast(*terms, constant=constant, confidence=ONE_SIDED)
    return three_way(test.low >= 0, test.high < 0, about)


def at_least(summary: Summary, limit: float, about: str) -> Answer:
    """Whether the mean is surely at least ``limit``."""
    return surely(f"{about} at least {limit:g}", (1.0, summary), constant=-limit)


def at_most(summary: Summary, limit: float, about: str) -> Answer:
    """Whether the mean is surely at most ``limit``."""
    return surely(f"{about} at most {limit:g}", (-1.0, summary), constant=limit)


def closing(distance: Summary, sac: Summary, part: float) -> Answer:
    """Whether surely at least ``part`` of SAC's gap is closed: (1 - part) d_SAC - d >= 0, which knows SAC's spread."""
    return surely(f"closes at least {100 * part:g} % of SAC's gap", (1 - part, sac), (-1.0, distance))


def staying_below(distance: Summary, sac: Summary, part: float) -> Answer:
    """Whether surely at most ``part`` of SAC's gap is closed."""
    return surely(f"closes at most {100 * part:g} % of SAC's gap", (1.0, distance), (-(1 - part), sac))


def closed(distance: Summary, sac: Summary) -> Estimate:
    """1 - d / d_SAC with Fieller's interval: SAC's gap is estimated too."""
    rest = fieller(distance, sac)
    return Estimate(1 - rest.value, 1 - rest.high, 1 - rest.low, rest.n)


def closed_in_paper(paper: float, sac: float, target: float) -> float:
    """1 - d / d_SAC of the paper's printed means."""
    return 1 - abs(paper - target) / abs(sac - target)


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
