"""What must be there before a unit is judged: results, agents that passed their gates, a gap, enough seeds."""

from collections.abc import Collection
from dataclasses import replace
from pathlib import Path

from mtcsirl.claims.evidence import Evidence, RewardSource
from mtcsirl.claims.gates import failed, needed
from mtcsirl.claims.groups import Group
from mtcsirl.claims.judging import (
    BLOCKED,
    JUDGED,
    MET,
    NOT_MET,
    NOT_RUN,
    TOO_FEW,
    UNCLEAR,
    Rules,
    Unit,
    at_least,
    closing,
)

CONDITIONAL = "conditional on the experts: all IRL seeds imitate those of the first seed"


def checked(
    evidence: Evidence,
    unit: Unit,
    rules: Rules,
    source: RewardSource | None,
    *groups: Group,
    pairs: int | None = None,
    irl_seeds: Collection[int] = (),
) -> Unit:
    """The unit, or why it cannot be judged: no results, failed experts, generators or SAC, no gap, too few seeds.

    Every one of ``groups`` that is plain SAC is asked for its task and for room between it and the target; ``pairs``:
    seeds of which both agents are there, where they are compared seed by seed; ``irl_seeds``: of the IRL runs of
    ``source``, unless the study's.
    """
    settings = evidence.settings
    results = Path(settings.results)
    folders = sorted(
        Path(folder).relative_to(results).as_posix() for folder in {one for group in groups for one in group.folders}
    )
    unit = replace(unit, folders=tuple(folders))
    seeds = [group.metric.n for group in groups] + ([] if pairs is None else [pairs])
    absent = [group.name for group in groups if group.metric.n == 0]
    if min(seeds) == 0:
        none = f"of {', '.join(dict.fromkeys(absent))} none" if 0 < len(absent) < len(groups) else "no agent"
        return unjudged(unit, NOT_RUN, f"{none} has been trained for this, or none is usable")
    for group in (group for group in groups if group.stage == "train_sac"):
        why = sac_fails(evidence, group, rules)
        if why:
            return unjudged(unit, BLOCKED, why)
        # few seeds of SAC do not show that it is on target
        if group.metric.n >= rules["seeds"] and no_gap(group, rules):
            return unjudged(unit, BLOCKED, "SAC alone is on target: there is no gap to close")
    if source is not None:
        seeds.append(len(set(irl_seeds or settings.irl_seeds)))
    return checked_runs(evidence, unit, rules, source, min(seeds), irl_seeds)


def no_gap(sac: Group, rules: Rules) -> bool:
    """Whether plain SAC is so near to the target that nothing can be seen to close its gap."""
    return bool(sac.distance.mean < rules["room"] * sac.target)


def unjudged(unit: Unit, state: str, reason: str) -> Unit:
    """The unit with the reason why it is not judged; nothing is said of what became of its agents."""
    return replace(unit, state=state, outcome="", reason=reason)


def checked_runs(
    evidence: Evidence,
    unit: Unit,
    rules: Rules,
    source: RewardSource | None,
    seeds: int,
    irl_seeds: Collection[int] = (),
) -> Unit:
    """The unit, or why it cannot be judged, for units without agents: correlations."""
    if seeds == 0:
        return unjudged(unit, NOT_RUN, "no reward has been scored for this")
    if source is not None:
        why, failed = evidence.blocked(source, rules["needs"], rules["gates"], irl_seeds)
        if why:
            return unjudged(unit, BLOCKED if failed else NOT_RUN, why)
        if source.one_expert:
            unit = replace(unit, notes=(*unit.notes, CONDITIONAL))
    if seeds < rules["seeds"]:
        return unjudged(unit, TOO_FEW, f"{seeds} of the {rules['seeds']} independent seeds a verdict needs")
    return unit


def failing(agents: Group, name: str, seeds: Collection[int], success: float, share: float) -> str:
    """Why so few ``agents`` do their task that nothing can be measured against them; "" if enough do.

    Of those that the study asks for, each task by ``seeds``, the whole number nearest to ``share`` of them has to pass
    its gate; those that are missing may yet. Nor may their success be surely below the gate's.
    """
    count = len(agents.agents) * len(set(seeds))
    lost = sum(int(failed(frame["status"]).sum()) for frame in agents.agents.values())
    if count - lost < needed(share, count):
        return f"{lost} of {count} {name} failed their gate"
    if at_least(agents.sure_success, success, "")[0] == NOT_MET:
        return f"{name} surely succeed in less than {100 * success:g} % of their episodes"
    return ""


def sac_fails(evidence: Evidence, sac: Group, rules: Rules) -> str:
    """Why plain SAC is no measure for others; "" if enough of it does its task."""
    settings = evidence.settings
    return failing(sac, "SAC agents", settings.seeds, settings.gates.success, rules["gates"])


def works_at_home(unit: Unit, own: Group, sac: Group, rules: Rules) -> Unit:
    """The unit, unless its reward fails on its own task too: then transfer is not what fails elsewhere.

    It fails there where it ruins its agents as well as where they stay behind.
    """
    answer, _ = closing(own.distance, sac.distance, rules["needs_diagonal"])
    ruined = at_least(own.sure_success, rules["success"], "")[0] == NOT_MET
    if unit.state in JUDGED and (answer == NOT_MET or ruined):
        why = "ruins its agents on" if ruined else "does not transfer to"
        return unjudged(unit, BLOCKED, f"its reward {why} its own task {'too' if ruined else 'either'}")
    if unit.state == MET and answer == UNCLEAR:
        return replace(unit, state=UNCLEAR, reason=f"{unit.reason}; transfers to its own task: {UNCLEAR}")
    return unit
