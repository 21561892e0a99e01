"""One judged unit of a claim, and the three-way answers that its state is put together from."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from mtcsirl.claims.evidence import Evidence
from mtcsirl.claims.groups import Group, closer
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
JUDGED = (MET, NOT_MET, UNCLEAR)
TOO_FEW, BLOCKED, NOT_RUN = "too few seeds", "precondition not met", "not run"
SHOWN = "not judged"
"""A unit that stands beside the judged ones for comparison."""
LIKE_SAC, TRANSFERS, RUINED, FARTHER = "like SAC", "behaviour transfers", "agent ruined", "farther than SAC"
NO_GAP, SAC_FAILS = "no gap to close", "SAC fails there"
UNDECIDED = "undecided"
"""What became of new agents where the claim is that nothing does."""
NO_ESTIMATE = Estimate(np.nan, np.nan, np.nan, 0)
ROUNDING = 1e-9
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


def worst(answers: Sequence[Answer]) -> str:
    """Not met if one answer is, else unclear if one is."""
    return next((state for state in (NOT_MET, UNCLEAR) if any(answer == state for answer, _ in answers)), MET)


def three_way(holds: bool, refuted: bool, about: str) -> Answer:
    """Met if it holds, not met if it is refuted, else unclear."""
    return (NOT_MET if refuted else MET if holds else UNCLEAR), about


def surely(about: str, *terms: tuple[float, Summary], constant: float = 0.0) -> Answer:
    """Met if the contrast (see ``statistics.contrast``) is at least 0, not met if it is below, each surely.

    Surely: by its one-sided 95 % bound. What floating point makes of the limit itself is on it.
    """
    test = contrast(*terms, constant=constant, confidence=ONE_SIDED)
    return three_way(test.low >= -ROUNDING, test.high < -ROUNDING, about)


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
