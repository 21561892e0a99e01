"""C3 and C6: claims that new agents do *not* acquire the behaviour, while they still do their task.

Such a claim is confirmed by an agent like SAC and by nothing else: neither by one that acquires the behaviour nor by
one that the learned reward has ruined.
"""

from collections.abc import Iterator

import numpy as np

from mtcsirl.claims.evidence import Evidence, multi_target, single_target
from mtcsirl.claims.groups import Group, behind
from mtcsirl.claims.judging import (
    FARTHER,
    LIKE_SAC,
    MET,
    NO_GAP,
    NOT_MET,
    RUINED,
    SAC_FAILS,
    TRANSFERS,
    UNCLEAR,
    UNDECIDED,
    Answer,
    Rules,
    Unit,
    against,
    at_least,
    closed,
    closed_in_paper,
    closing,
    judged_unit,
    staying_below,
    surely,
    tasks_of,
    three_way,
    worst,
)
from mtcsirl.claims.preconditions import checked, no_gap, sac_fails, works_at_home
from mtcsirl.results.contrasts import Nearness, equivalence_power, nearness
from mtcsirl.results.published import in_paper_order
from mtcsirl.results.statistics import Interval, Summary

OUTCOMES = (LIKE_SAC, TRANSFERS, RUINED, FARTHER, UNDECIDED, NO_GAP, SAC_FAILS)


def equivalent_to_sac(evidence: Evidence, rules: Rules) -> Iterator[Unit]:
    """C3: the new agent succeeds, and its metric equals plain SAC's within a part of the gap from SAC to the target."""
    for cs in in_paper_order(evidence.settings.cs_rewards):
        for task in tasks_of(evidence, rules["units"]):
            source = single_target(evidence.settings, cs, task)
            group, sac = evidence.transfers(source, [task]), evidence.sac(cs, [task])
            margin = rules["margin"]
            near = nearness(group.metric, sac.metric, group.target, margin)
            success = at_least(group.sure_success, rules["success"], "success")
            parts = [
                three_way(near.inside, near.above or near.below, f"within {100 * margin:g} % of SAC's gap of SAC"),
                success,
            ]
            power = equivalence_power(group.metric, sac.metric, group.target, margin, np.random.default_rng(0))
            measure = "part of the gap from SAC to the target closed"
            unit = judged_unit(
                cs, task, group, parts, measure, closed(group.gap, sac.gap), power=power,
                outcome=_outcome(success, near, group, sac), holds=Interval(-margin, margin),
            )  # fmt: skip
            yield checked(evidence, against(unit, group, sac, "SAC"), rules, source, group, sac)


def _outcome(success: Answer, near: Nearness, group: Group, sac: Group) -> str:
    if success[0] == NOT_MET:
        return RUINED
    if near.below:
        return FARTHER
    if near.above:  # on the target's side of SAC, but perhaps far beyond the target
        nearer, _ = surely("", (1.0, sac.distance), (-1.0, group.distance))
        return {MET: TRANSFERS, NOT_MET: FARTHER}.get(nearer, UNDECIDED)
    return LIKE_SAC if near.inside and success[0] == MET else UNDECIDED


def stays_behind(evidence: Evidence, rules: Rules) -> Iterator[Unit]:
    """C6: on other tasks the reward of one task closes little of SAC's gap, less than on its own, on hardly any much.

    A unit is a reward's source; each of the other tasks is judged by itself, so that two on which it transfers fully do
    not hide behind three on which it does harm.
    """
    settings, paper = evidence.settings, evidence.published
    for cs in in_paper_order(settings.cs_rewards):
        tasks = settings.multi_target.tasks
        for home in tasks if len(tasks) > 1 else ():
            others = [task for task in tasks if task != home]
            source = multi_target(settings, cs, home)
            group, own = evidence.transfers(source, others), evidence.transfers(source, [home])
            sac, sac_own = evidence.sac(cs, others), evidence.sac(cs, [home])
            lead = behind(group, own)
            fates = {task: _fate(evidence, group.on(task), sac.on(task), rules) for task in others}
            parts = [
                staying_below(group.distance, sac.distance, rules["at_most"]),
                surely("behind its own task, seed by seed", (1.0, lead)),
                _most([answer for answer, _ in fates.values()], rules["share"]),
            ]
            outcomes = [outcome for _, outcome in fates.values()]
            printed = float(np.mean([paper.cross_transfer(cs, home, task).mean for task in others]))
            printed_sac = float(np.mean([paper.cross_baseline(cs, task).mean for task in others]))
            unit = judged_unit(
                cs, home, group, parts, "part of SAC's gap closed off its task", closed(group.distance, sac.distance),
                Summary(printed * group.target, np.nan, paper.seeds), outcome=_summed(outcomes),
                paper_value=closed_in_paper(printed, printed_sac, 1.0), holds=Interval(-np.inf, rules["at_most"]),
            )  # fmt: skip
            groups = group, sac, own, sac_own
            unit = checked(evidence, against(unit, group, own, "own task"), rules, source, *groups, pairs=lead.n)
            # Transfer elsewhere contradicts the claim, whatever becomes of the reward's own task.
            against_it = unit.state == NOT_MET and TRANSFERS in outcomes
            yield unit if against_it else works_at_home(unit, own, sac_own, rules)


def _fate(evidence: Evidence, group: Group, sac: Group, rules: Rules) -> Answer:
    """Of one task: whether the behaviour surely does not transfer to an agent that succeeds, and what became of it.

    A task without a gap says neither: whoever is near SAC there is on target too. Nor does one that plain SAC fails.
    """
    if no_gap(sac, rules):
        return UNCLEAR, NO_GAP
    if sac_fails(evidence, sac, rules):
        return UNCLEAR, SAC_FAILS
    success = at_least(group.sure_success, rules["success"], "")
    much = closing(group.distance, sac.distance, rules["needs_diagonal"])
    little = staying_below(group.distance, sac.distance, rules["needs_diagonal"])
    if success[0] == NOT_MET:
        outcome = RUINED
    elif much[0] == MET:
        outcome = TRANSFERS
    else:
        like = staying_below(group.distance, sac.distance, rules["at_most"])
        away = staying_below(group.distance, sac.distance, -rules["at_most"])
        beyond = nearness(group.metric, sac.metric, group.target, 1.0).above  # on the far side of the target
        other = FARTHER if away[0] == MET or beyond else LIKE_SAC
        outcome = other if worst([success, like]) == MET else UNDECIDED
    return worst([success, little]), outcome


def _most(states: list[str], share: float) -> Answer:
    """Met if ``share`` of ``states`` are met, not met if they cannot be any more."""
    met, lost = states.count(MET), states.count(NOT_MET)
    needed = share * len(states) - 1e-9
    about = f"fails to transfer without ruin on {100 * share:g} % of the other tasks"
    return three_way(met >= needed, len(states) - lost < needed, about)


def _summed(outcomes: list[str]) -> str:
    """As in "3 like SAC, 1 agent ruined"; all alike: without numbers."""
    names = [name for name in OUTCOMES if name in outcomes]
    return names[0] if len(names) == 1 else ", ".join(f"{outcomes.count(name)} {name}" for name in names)
