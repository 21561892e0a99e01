"""The criteria of ``claims.yaml``, one function per kind: evidence in, judged units out."""

import math
from collections.abc import Callable, Iterator
from dataclasses import replace

import numpy as np

from mtcsirl.claims.evidence import Evidence, multi_target, multi_task, single_target
from mtcsirl.claims.judging import (
    BLOCKED,
    CORRELATION,
    MET,
    NOT_MET,
    UNCLEAR,
    Rules,
    Unit,
    advantage,
    against,
    at_least,
    at_most,
    checked,
    checked_runs,
    closed,
    closed_in_paper,
    closing,
    judge_correlation,
    judged_unit,
    scaled,
    tasks_of,
    three_way,
)
from mtcsirl.results.published import UNKNOWN as NOT_PRINTED
from mtcsirl.results.published import in_paper_order
from mtcsirl.results.rows import select
from mtcsirl.results.statistics import Estimate, Interval, Summary, equivalent, mean_correlation, t_interval, welch


def on_target(evidence: Evidence, rules: Rules) -> Iterator[Unit]:
    """C1, C2, C11: agents are on target and succeed."""
    settings, paper = evidence.settings, evidence.published
    for cs in in_paper_order(settings.cs_rewards):
        target = paper.target(cs)
        for task in tasks_of(evidence, rules["units"]):
            reference, name = evidence.sac(cs, [task]), "SAC"
            if rules["agent"] == "expert":
                run, group, printed = None, evidence.experts(cs, [task]), paper.unseen("expert", cs, cs)
            elif rules["agent"] == "generator":
                run, printed = single_target(cs, task), NOT_PRINTED
                group = evidence.generators(run)
            else:
                run = multi_task(settings, cs, "mt_csirl_lt")
                group = evidence.transfers(run, [task], settings.multi_task.train_targets[0])
                printed = scaled(paper.learned_task(task, cs, cs), target)
                reference, name = evidence.generators(run, [task]), "IRL agent"
            limit = rules["distance"].get(cs, max(rules["distance"].values()))
            distance = scaled(group.distance, 1 / target)
            parts = [
                at_most(distance, limit, "distance to the target"),
                at_least(group.success, rules["success"], "success"),
            ]
            value = Estimate(distance.mean, *t_interval(distance), distance.n)
            theirs = abs(printed.mean / target - 1)
            unit = judged_unit(cs, task, group, parts, "distance to the target / target", value, printed, theirs)
            yield checked(evidence, against(unit, group, reference, name), rules, run, group)


def equivalent_to_sac(evidence: Evidence, rules: Rules) -> Iterator[Unit]:
    """C3: the new agent's metric equals plain SAC's within a margin of the gap from SAC to expert."""
    for cs in in_paper_order(evidence.settings.cs_rewards):
        for task in tasks_of(evidence, rules["units"]):
            run = single_target(cs, task)
            group, sac, expert = (
                evidence.transfers(run, [task]), evidence.sac(cs, [task]), evidence.experts(cs, [task])
            )  # fmt: skip
            ours, base = group.metric, sac.metric
            # Only the experts behind the demonstrations need to be there; without any, the target stands in.
            goal = expert.metric.mean if expert.metric.n else group.target
            gap = (goal - base.mean) or math.nan  # without a gap nothing can be said in parts of it
            test = welch(ours, base)
            margin = rules["margin"] * abs(gap)
            if equivalent(ours, base, margin):
                parts = [(MET, "equal to SAC within the margin")]
            elif test.low > margin or test.high < -margin:
                parts = [(NOT_MET, "differs from SAC by more than the margin")]
            else:
                parts = [(UNCLEAR, "neither equal nor different with these seeds")]
            low, high = sorted((test.low / gap, test.high / gap))
            value = Estimate(test.difference / gap, low, high, ours.n)
            unit = judged_unit(cs, task, group, parts, "difference to SAC / gap from SAC to expert", value)
            yield checked(evidence, against(unit, group, sac, "SAC"), rules, run, group, sac)


def correlation(evidence: Evidence, rules: Rules) -> Iterator[Unit]:
    """C4, C9: Pearson's r of learned and true reward, mean over IRL seeds on Fisher's z scale."""
    settings = evidence.settings
    for cs in in_paper_order(settings.cs_rewards):
        if rules["experiment"] == "single_target":
            run = single_target(cs, settings.single_target.tasks[0])
        else:
            run = multi_task(settings, cs, "mt_csirl")
        chosen = select(
            evidence.scores,
            **run.key,
            transitions=rules["transitions"],
            reward="learned",
            statistic="pearson",
        )
        r = mean_correlation(chosen["value"])
        printed = evidence.published.correlation(rules["experiment"], cs)
        unit = Unit(
            cs_reward=cs,
            what=run.source,
            state=judge_correlation(r, rules),
            reason=f"on {rules['transitions']} transitions",
            measure=CORRELATION,
            value=r,
            ours=Summary(r.value, float(chosen["value"].std()), r.n),
            interval=Interval(r.low, r.high),
            paper=printed,
            paper_value=printed.mean,
        )
        yield checked_runs(evidence, unit, rules, run, r.n)


def closes_gap(evidence: Evidence, rules: Rules) -> Iterator[Unit]:
    """C5, C7, C10: new agents close a stated part of SAC's gap and succeed."""
    settings, paper = evidence.settings, evidence.published
    for cs in in_paper_order(settings.cs_rewards):
        if rules["units"] == "unseen":
            run, tasks = multi_task(settings, cs, rules["method"]), settings.multi_task.unseen_tasks
            cases = [
                (run, tasks, "unseen tasks", paper.unseen(rules["method"], cs, cs), paper.unseen("sac", cs, cs).mean)
            ]
        else:
            target = paper.target(cs)
            cases = [
                (multi_target(settings, cs, task), (task,), task,
                 scaled(paper.cross_transfer(cs, task, task), target), target * paper.cross_baseline(cs, task).mean)
                for task in settings.multi_target.tasks
            ]  # fmt: skip
        for run, tasks, what, printed, printed_sac in cases:
            group, sac = evidence.transfers(run, tasks), evidence.sac(cs, tasks)
            parts = [
                closing(group.distance, sac.distance, rules["at_least"]),
                at_least(group.success, rules["success"], "success"),
            ]
            theirs = closed_in_paper(printed.mean, printed_sac, paper.target(cs))
            unit = judged_unit(cs, what, group, parts, "part of SAC's gap closed", closed(group, sac), printed, theirs)
            yield checked(evidence, against(unit, group, sac, "SAC"), rules, run, group, sac)


def stays_behind(evidence: Evidence, rules: Rules) -> Iterator[Unit]:
    """C6: on other tasks the reward of one task closes little of SAC's gap, and less than on its own."""
    settings, paper = evidence.settings, evidence.published
    for cs in in_paper_order(settings.cs_rewards):
        tasks = settings.multi_target.tasks
        for source in tasks if len(tasks) > 1 else ():
            others = [task for task in tasks if task != source]
            run = multi_target(settings, cs, source)
            group, own = evidence.transfers(run, others), evidence.transfers(run, [source])
            sac, sac_own = evidence.sac(cs, others), evidence.sac(cs, [source])
            far, base = group.distance, sac.distance
            contrast = welch(far, scaled(base, 1 - rules["at_most"]))
            behind = welch(far, own.distance)
            parts = [
                three_way(contrast.difference >= 0, contrast.high < 0, "closes no more than the limit off its task"),
                three_way(behind.low > 0, behind.high < 0, "stays behind its own task"),
            ]
            printed = float(np.mean([paper.cross_transfer(cs, source, task).mean for task in others]))
            printed_sac = float(np.mean([paper.cross_baseline(cs, task).mean for task in others]))
            cell = Summary(printed * paper.target(cs), np.nan, paper.seeds)
            measure, theirs = "part of SAC's gap closed off its task", closed_in_paper(printed, printed_sac, 1.0)
            unit = judged_unit(cs, source, group, parts, measure, closed(group, sac), cell, theirs)
            unit = checked(evidence, against(unit, group, own, "own task"), rules, run, group, sac, own, sac_own)
            needed, _ = closing(own.distance, sac_own.distance, rules["needs_diagonal"])
            if unit.state in (MET, UNCLEAR) and needed != MET:
                unit = replace(unit, state=BLOCKED, reason="its reward does not transfer to its own task either")
            yield unit


def better_than(evidence: Evidence, rules: Rules) -> Iterator[Unit]:
    """C8: the method is closer to the target and succeeds more often than each of the others."""
    settings, paper = evidence.settings, evidence.published
    tasks = settings.multi_task.unseen_tasks
    for cs in in_paper_order(settings.cs_rewards):
        run = multi_task(settings, cs, rules["method"])
        ours, sac = evidence.transfers(run, tasks), evidence.sac(cs, tasks)
        for other in rules["others"]:
            theirs = evidence.transfers(multi_task(settings, cs, other), tasks)
            needed = rules["metric_advantage"] * sac.distance.mean
            nearer, oftener = welch(theirs.distance, ours.distance), welch(ours.success, theirs.success)
            parts = [
                advantage(nearer, needed, "closer to the target"),
                advantage(oftener, rules["success_advantage"], "more often successful"),
            ]
            gap = sac.distance.mean or math.nan
            value = Estimate(nearer.difference / gap, nearer.low / gap, nearer.high / gap, theirs.distance.n)
            printed = paper.unseen(other, cs, cs)
            best, worst = (paper.unseen(name, cs, cs).mean for name in (rules["method"], "sac"))
            lost = closed_in_paper(best, worst, paper.target(cs)) - closed_in_paper(
                printed.mean, worst, paper.target(cs)
            )
            measure = "distance lost to MT-CSIRL / SAC's gap"
            unit = judged_unit(cs, other, theirs, parts, measure, value, printed, lost)
            unit = against(unit, theirs, ours, "MT-CSIRL")
            yield checked(evidence, unit, rules, run, ours, theirs, sac)


def suffers_without(evidence: Evidence, rules: Rules) -> Iterator[Unit]:
    """C12: generators trained without the curriculum succeed less often than those trained with it."""
    cs = evidence.settings.ablations.cs_reward
    for task in evidence.settings.ablations.tasks:
        run = single_target(cs, task)
        with_it = evidence.generators(run)
        without = evidence.generators(replace(run, experiment=rules["experiment"]))
        test = welch(with_it.success, without.success)
        parts = [advantage(test, rules["advantage"], "more often successful with the curriculum")]
        value = Estimate(test.difference, test.low, test.high, without.success.n)
        unit = judged_unit(cs, task, without, parts, "success lost without the curriculum", value)
        yield checked(evidence, against(unit, without, with_it, "with the curriculum"), rules, run, with_it, without)


KINDS: dict[str, Callable[[Evidence, Rules], Iterator[Unit]]] = {
    "on_target": on_target,
    "equivalent_to_sac": equivalent_to_sac,
    "correlation": correlation,
    "closes_gap": closes_gap,
    "stays_behind": stays_behind,
    "better_than": better_than,
    "suffers_without": suffers_without,
}
