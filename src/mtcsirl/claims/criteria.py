"""The criteria of ``claims.yaml``, one function per kind: evidence in, judged units out.

Here those about agents that do something; :mod:`mtcsirl.claims.failures` has those about agents that do not, and
:mod:`mtcsirl.claims.scored` those about the rewards themselves.
"""

from collections.abc import Callable, Iterator
from dataclasses import replace

import numpy as np

from mtcsirl.claims.evidence import Evidence, RewardSource, multi_target, multi_task, single_target
from mtcsirl.claims.failures import equivalent_to_sac, stays_behind
from mtcsirl.claims.groups import Group, behind
from mtcsirl.claims.judging import (
    BLOCKED,
    JUDGED,
    MET,
    NOT_MET,
    NOT_RUN,
    SHOWN,
    Answer,
    Rules,
    Unit,
    against,
    at_least,
    at_most,
    closed,
    closed_in_paper,
    closing,
    judged_unit,
    scaled,
    surely,
    tasks_of,
    worst,
)
from mtcsirl.claims.preconditions import checked, failing, unjudged, works_at_home
from mtcsirl.claims.scored import correlation
from mtcsirl.results.contrasts import fieller, fieller_of
from mtcsirl.results.published import NOT_PRINTED, Published, in_paper_order
from mtcsirl.results.statistics import UNKNOWN_INTERVAL, Estimate, Interval, Summary, contrast, t_interval, welch

NO_SUCH_MEAN = "the paper's number is the mean over its unseen tasks"


def on_target(evidence: Evidence, rules: Rules) -> Iterator[Unit]:
    """C1, C2, C11: agents are on target and succeed."""
    settings, paper = evidence.settings, evidence.published
    for cs in in_paper_order(settings.cs_rewards):
        for task in tasks_of(evidence, rules["units"]):
            source: RewardSource | None = None
            reference, name, printed = evidence.sac(cs, [task]), "SAC", NOT_PRINTED
            if rules["agent"] == "expert":
                group, printed = evidence.experts(cs, [task]), paper.unseen("expert", cs, cs)
            elif rules["agent"] == "generator":
                source = single_target(settings, cs, task)
                group = evidence.generators(source)
            else:
                source = multi_task(settings, cs, "mt_csirl_lt")
                group = evidence.transfers(source, [task], settings.multi_task.train_targets[0])
                printed = scaled(paper.learned_task(task, cs, cs), group.target)
                reference, name = evidence.generators(source, [task]), "IRL agent"
            limit = rules["distance"].get(cs, max(rules["distance"].values()))
            distance = scaled(group.distance, 1 / group.target)
            parts = [
                at_most(distance, limit, "distance to the target"),
                at_least(group.sure_success, rules["success"], "success"),
            ]
            value = Estimate(distance.mean, *t_interval(distance), distance.n)
            theirs = abs(printed.mean / group.target - 1)
            unit = judged_unit(
                cs, task, group, parts, "distance to the target / target", value, printed, paper_value=theirs,
                holds=Interval(-np.inf, limit),
            )  # fmt: skip
            if rules["agent"] == "expert":
                unit = _of_a_mean(unit)
            yield checked(evidence, against(unit, group, reference, name), rules, source, group)


def _of_a_mean(unit: Unit) -> Unit:
    """The unit of one task beside a number of the paper that is a mean over tasks: it predicts no single task."""
    return replace(unit, paper=NOT_PRINTED, prediction=UNKNOWN_INTERVAL, notes=(*unit.notes, NO_SUCH_MEAN))


def closes_gap(evidence: Evidence, rules: Rules) -> Iterator[Unit]:
    """C5, C7, C10: new agents close a stated part of SAC's gap and succeed, on each task.

    On unseen tasks the mean over tasks stands in front, not judged, beside the paper's, which prints no other.
    """
    settings, paper = evidence.settings, evidence.published
    for cs in in_paper_order(settings.cs_rewards):
        if rules["units"] == "diagonal":
            for task in settings.multi_target.tasks:
                source = multi_target(settings, cs, task)
                target = evidence.sac(cs, [task]).target
                printed, base = (
                    scaled(x, target) for x in (paper.cross_transfer(cs, task, task), paper.cross_baseline(cs, task))
                )
                yield _closing_unit(evidence, rules, source, (task,), task, printed, base.mean)
            continue
        source, tasks = multi_task(settings, cs, rules["method"]), settings.multi_task.unseen_tasks
        printed, base = paper.unseen(rules["method"], cs, cs), paper.unseen("sac", cs, cs)
        yield _all_unseen(evidence, rules, _closing_unit(evidence, rules, source, tasks, "all", printed, base.mean))
        for task in tasks:
            yield _of_a_mean(_closing_unit(evidence, rules, source, (task,), task, printed, base.mean))


def _closing_unit(
    evidence: Evidence, rules: Rules, source: RewardSource, tasks: tuple[str, ...], what: str, printed: Summary,
    printed_sac: float,
) -> Unit:  # fmt: skip
    cs = source.cs_reward
    group, sac = evidence.transfers(source, tasks), evidence.sac(cs, tasks)
    parts = [
        closing(group.distance, sac.distance, rules["at_least"]),
        at_least(group.sure_success, rules["success"], "success"),
    ]
    theirs = closed_in_paper(printed.mean, printed_sac, group.target)
    value = closed(group.distance, sac.distance)
    unit = judged_unit(
        cs, what, group, parts, "part of SAC's gap closed", value, printed, paper_value=theirs,
        holds=Interval(rules["at_least"], np.inf),
    )  # fmt: skip
    return checked(evidence, against(unit, group, sac, "SAC"), rules, source, group, sac)


def _all_unseen(evidence: Evidence, rules: Rules, unit: Unit) -> Unit:
    """The mean over unseen tasks, and whether the experts are closer to the target, as Table 2's text says.

    "Not as strongly as the ground truth" qualifies C7 and has no size in the paper, so it is a note here and no claim.
    """
    cs, tasks = unit.cs_reward, evidence.settings.multi_task.unseen_tasks
    ours = evidence.transfers(multi_task(evidence.settings, cs, rules["method"]), tasks).distance
    experts = evidence.experts(cs, tasks).distance
    answer, _ = surely("", (1.0, ours), (-1.0, experts))
    test = welch(ours, experts)
    bounds = f" [{test.low:+.2f}, {test.high:+.2f}]" if np.isfinite(test.low) else ""
    note = f'"not as strongly as the ground truth": {answer}; d less the experts\' is {test.difference:+.2f}{bounds}'
    notes = (*unit.notes, note) if experts.n and ours.n else unit.notes
    return replace(unit, what="all unseen tasks", state=SHOWN, notes=notes)


def better_than(evidence: Evidence, rules: Rules) -> Iterator[Unit]:
    """C8: the method is closer to the target, and succeeds more often, than each of the others; one unit each."""
    settings, paper = evidence.settings, evidence.published
    tasks, method = settings.multi_task.unseen_tasks, rules["method"]
    for cs in in_paper_order(settings.cs_rewards):
        source = multi_task(settings, cs, method)
        ours, sac = evidence.transfers(source, tasks), evidence.sac(cs, tasks)
        for other in rules["others"]:
            theirs, name = evidence.transfers(multi_task(settings, cs, other), tasks), other.replace("_", "-").upper()
            for unit in (
                _worse_metric(ours, theirs, sac, f"{name}, metric", rules["metric_advantage"], paper, method, other),
                _worse_success(ours, theirs, f"{name}, success", rules["success_advantage"], paper, method, other),
            ):
                yield checked(evidence, against(unit, theirs, ours, "MT-CSIRL"), rules, source, ours, theirs, sac)


def _worse_metric(
    ours: Group, theirs: Group, sac: Group, what: str, needed: float, paper: Published, method: str, other: str
) -> Unit:
    cs = ours.cs_reward
    terms = (1.0, theirs.distance), (-1.0, ours.distance), (-needed, sac.distance)
    part = surely(f"farther from the target by {100 * needed:g} % of SAC's gap", *terms)
    value = fieller_of([(1.0, theirs.distance), (-1.0, ours.distance)], sac.distance)
    best, worst, printed = (paper.unseen(name, cs, cs).mean for name in (method, "sac", other))
    lost = closed_in_paper(best, worst, ours.target) - closed_in_paper(printed, worst, ours.target)
    return judged_unit(
        cs, what, theirs, [part], "distance lost to MT-CSIRL / SAC's gap", value, paper.unseen(other, cs, cs),
        paper_value=lost, holds=Interval(needed, np.inf),
    )  # fmt: skip


def _worse_success(
    ours: Group, theirs: Group, what: str, needed: float, paper: Published, method: str, other: str
) -> Unit:
    cs = ours.cs_reward
    terms = (1.0, ours.sure_success), (-1.0, theirs.sure_success)
    part = surely(f"less success by {100 * needed:g} points", *terms, constant=-needed)
    test = contrast(*terms)
    value = Estimate(test.difference, test.low, test.high, theirs.success.n)
    lost = paper.unseen(method, cs, "success").mean - paper.unseen(other, cs, "success").mean
    return judged_unit(
        cs, what, theirs, [part], "success lost to MT-CSIRL", value, paper.unseen(other, cs, cs),
        paper_value=lost, holds=Interval(needed, np.inf),
    )  # fmt: skip


def suffers_without(evidence: Evidence, rules: Rules) -> Iterator[Unit]:
    """C12: generators trained without the curriculum succeed less often than those trained with it."""
    cs, needed = evidence.settings.ablations.cs_reward, rules["advantage"]
    for task in evidence.settings.ablations.tasks:
        source, seeds = single_target(evidence.settings, cs, task), evidence.settings.ablations.seeds
        with_it = evidence.generators(source, seeds=seeds)
        without = evidence.generators(replace(source, experiment=rules["experiment"]), seeds=seeds)
        terms = (1.0, with_it.sure_success), (-1.0, without.sure_success)
        parts = [surely(f"less success without it by {100 * needed:g} points", *terms, constant=-needed)]
        test = contrast(*terms)
        value = Estimate(test.difference, test.low, test.high, without.success.n)
        unit = judged_unit(
            cs, task, without, parts, "success lost without the curriculum", value, holds=Interval(needed, np.inf)
        )  # fmt: skip
        unit = against(unit, without, with_it, "with the curriculum")
        unit = checked(evidence, unit, rules, source, with_it, without, irl_seeds=seeds)
        # Where they fail with it as well, they have nothing to lose.
        why = failing(with_it, "generators with it", seeds, evidence.settings.gates.success, rules["gates"])
        yield unjudged(unit, BLOCKED, why) if why and unit.state in JUDGED else unit


def beats_single(evidence: Evidence, rules: Rules) -> Iterator[Unit]:
    """C13: the reward of several tasks beats that of one of them on the same unseen tasks, seed by seed."""
    settings = evidence.settings
    tasks = [task for task in settings.multi_target.tasks if task in settings.multi_task.unseen_tasks]
    singles = [task for task in settings.multi_target.tasks if task in settings.multi_task.train_tasks]
    for cs in in_paper_order(settings.cs_rewards):
        several = multi_task(settings, cs, rules["method"])
        for single in singles:
            for task in tasks:
                yield _against_single(evidence, rules, several, multi_target(settings, cs, single), task)


def _against_single(evidence: Evidence, rules: Rules, several: RewardSource, single: RewardSource, task: str) -> Unit:
    cs, home = single.cs_reward, single.source
    ours, theirs = evidence.transfers(several, [task]), evidence.transfers(single, [task])
    own, sac, sac_own = evidence.transfers(single, [home]), evidence.sac(cs, [task]), evidence.sac(cs, [home])
    lead, needed = behind(theirs, ours), rules["advantage"]
    parts = [
        surely(f"closer than {home}'s by {100 * needed:g} % of SAC's gap", (1.0, lead), (-needed, sac.distance)),
        at_least(ours.sure_success, rules["success"], "success"),
        *_as_the_text_says(ours, theirs, sac, home, rules),
    ]
    value = fieller(lead, sac.distance)
    unit = judged_unit(
        cs, task, ours, parts, "lead over one task's reward / SAC's gap", value, holds=Interval(needed, np.inf),
        paper_value=_lead_in_paper(evidence.published, cs, home, task, rules["method"], ours.target),
    )  # fmt: skip
    groups = ours, theirs, own, sac, sac_own
    unit = checked(evidence, against(unit, ours, theirs, f"{home}'s reward"), rules, single, *groups, pairs=lead.n)
    why, failed = evidence.blocked(several, ["experts"], rules["gates"])
    if why and unit.state in JUDGED:
        return unjudged(unit, BLOCKED if failed else NOT_RUN, why)
    return works_at_home(unit, own, sac_own, rules)


def _as_the_text_says(ours: Group, theirs: Group, sac: Group, home: str, rules: Rules) -> Iterator[Answer]:
    """The claim's text, where its criterion does not say it: one reward transfers, as in C7, where the other does not.

    Only a sure contradiction counts, so that the criterion decides wherever the text does not rule it out.
    """
    part = rules["needs_diagonal"]
    if closing(ours.distance, sac.distance, part)[0] == NOT_MET:
        yield NOT_MET, f"transfers itself (closes {100 * part:g} % of SAC's gap)"
    other = closing(theirs.distance, sac.distance, part), at_least(theirs.sure_success, rules["success"], "")
    if worst(other) == MET:
        yield NOT_MET, f"{home}'s reward does not transfer"


def _lead_in_paper(paper: Published, cs: str, home: str, task: str, method: str, target: float) -> float:
    """Part of SAC's gap closed: Table 2's mean over unseen tasks minus the cell of Table 1 or 3."""
    several = closed_in_paper(paper.unseen(method, cs, cs).mean, paper.unseen("sac", cs, cs).mean, target)
    cell, base = paper.cross_transfer(cs, home, task).mean, paper.cross_baseline(cs, task).mean
    return several - closed_in_paper(cell, base, 1.0)


KINDS: dict[str, Callable[[Evidence, Rules], Iterator[Unit]]] = {
    "on_target": on_target,
    "equivalent_to_sac": equivalent_to_sac,
    "correlation": correlation,
    "closes_gap": closes_gap,
    "stays_behind": stays_behind,
    "better_than": better_than,
    "suffers_without": suffers_without,
    "beats_single": beats_single,
}
