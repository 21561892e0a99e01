"""What each artefact of the paper needs, as runs of :mod:`mtcsirl.study.runs`."""

from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace
from typing import Any, TypeVar

from mtcsirl.errors import UserError
from mtcsirl.names import EVALUATION_TARGET
from mtcsirl.settings import Settings
from mtcsirl.study.ablations import ABLATIONS
from mtcsirl.study.keys import Run
from mtcsirl.study.runs import AnyRun, Baseline, Demonstrations, Expert, IrlRun, Runs, Score, Transfer

FIGURE_TASKS = {
    "figure_2": "reach-wall",
    "figure_4": "button-press-topdown-wall",
    "figure_5": "coffee-button",
    "figure_s1": "drawer-close",
    "figure_s2": "push-back",
}
"""Learning curves of section 5.1; the paper's text and captions disagree on the tasks, so all five exist."""


def irl_seed(settings: Settings, seed: int) -> int:
    """The seed of the IRL run whose reward the transfer agent of ``seed`` gets."""
    if seed in settings.irl_seeds:
        return seed
    return settings.irl_seeds[settings.seeds.index(seed) % len(settings.irl_seeds)]


def _demonstrations(cs_reward: str, members: Iterable[tuple[str, int]], seed: int) -> tuple[Demonstrations, ...]:
    return tuple(Demonstrations(Expert(cs_reward, task, target, seed)) for task, target in members)


def _single_irl(settings: Settings, task: str, cs_reward: str, seed: int) -> IrlRun:
    """A seed is a replicate: its IRL run imitates the expert of the same seed."""
    shown = _demonstrations(cs_reward, [(task, EVALUATION_TARGET)], seed)
    return IrlRun("single_target", settings.single_target.method, cs_reward, task, seed, shown)


def _multi_target_irl(settings: Settings, task: str, cs_reward: str, seed: int) -> IrlRun:
    """One expert per target, that of the first seed: results are conditional on the experts."""
    members = [(task, target) for target in settings.multi_target.train_targets]
    shown = _demonstrations(cs_reward, members, settings.seeds[0])
    return IrlRun("multi_target", settings.multi_target.method, cs_reward, task, seed, shown)


def _multi_task_irl(settings: Settings, method: str, cs_reward: str, seed: int) -> IrlRun:
    """As with a single target, each seed has experts of its own."""
    chosen = settings.multi_task
    members = [(task, target) for task in chosen.train_tasks for target in chosen.train_targets]
    return IrlRun("multi_task", method, cs_reward, "all", seed, _demonstrations(cs_reward, members, seed))


def _baselines(settings: Settings, tasks: Iterable[str]) -> Iterator[Baseline]:
    return (Baseline(task, EVALUATION_TARGET, seed) for task in tasks for seed in settings.seeds)


def _experts(settings: Settings, tasks: Iterable[str], cs_rewards: Iterable[str]) -> Iterator[Expert]:
    tasks = tuple(tasks)
    return (Expert(cs, task, EVALUATION_TARGET, seed) for cs in cs_rewards for task in tasks for seed in settings.seeds)


def _score(settings: Settings, irl: IrlRun, task: str) -> Score:
    experts = tuple(Expert(irl.cs_reward, task, EVALUATION_TARGET, seed) for seed in settings.seeds)
    return Score(irl, task, experts, tuple(Baseline(task, EVALUATION_TARGET, seed) for seed in settings.seeds))


def _single_target_curves(settings: Settings, task: str) -> Iterator[AnyRun]:
    """Figures 2, 4, 5: IRL agent, Transferred and SAC on the task and target of the expert."""
    if task not in settings.single_target.tasks:
        return
    yield from _baselines(settings, [task])
    for cs in settings.cs_rewards:
        for seed in settings.seeds:
            yield Transfer(_single_irl(settings, task, cs, irl_seed(settings, seed)), task, EVALUATION_TARGET, seed)


def _single_target_scores(settings: Settings, cs_reward: str, tasks: Iterable[str]) -> Iterator[AnyRun]:
    """Figures 2c and 6, claim C4: the reward of one task against the truth on that task."""
    for task in tasks if cs_reward in settings.cs_rewards else ():
        for seed in settings.irl_seeds:
            yield _score(settings, _single_irl(settings, task, cs_reward, seed), task)


def _multi_task_scores(settings: Settings, cs_reward: str, tasks: Iterable[str]) -> Iterator[AnyRun]:
    """Figures 3c and 7, claim C9: the reward of several tasks against the truth on unseen tasks."""
    if cs_reward in settings.cs_rewards and "mt_csirl" in settings.methods:
        for task in tasks:
            for seed in settings.irl_seeds:
                yield _score(settings, _multi_task_irl(settings, "mt_csirl", cs_reward, seed), task)


def _cross_transfer(settings: Settings, cs_reward: str) -> Iterator[AnyRun]:
    """Tables 1 and 3: the reward of each task (several targets) on the new target of every task."""
    tasks = settings.multi_target.tasks
    yield from _baselines(settings, tasks)
    for source in tasks if cs_reward in settings.cs_rewards else ():
        for seed in settings.seeds:
            irl = _multi_target_irl(settings, source, cs_reward, irl_seed(settings, seed))
            yield from (Transfer(irl, task, EVALUATION_TARGET, seed) for task in tasks)


def _unseen(settings: Settings, methods: Iterable[str], cs_rewards: Iterable[str]) -> Iterator[AnyRun]:
    for method in methods:
        for cs in cs_rewards:
            for seed in settings.seeds:
                irl = _multi_task_irl(settings, method, cs, irl_seed(settings, seed))
                for task in settings.multi_task.unseen_tasks:
                    yield Transfer(irl, task, EVALUATION_TARGET, seed)


def _table_2(settings: Settings) -> Iterator[AnyRun]:
    yield from _experts(settings, settings.multi_task.unseen_tasks, settings.cs_rewards)
    yield from _baselines(settings, settings.multi_task.unseen_tasks)
    yield from _unseen(settings, settings.methods, settings.cs_rewards)


def _table_4(settings: Settings) -> Iterator[AnyRun]:
    """MT-CSIRL+LT: both learned rewards, new agents on tasks and targets that the IRL has seen."""
    if "mt_csirl_lt" not in settings.methods:
        return
    chosen = settings.multi_task
    for cs in settings.cs_rewards:
        for seed in settings.seeds:
            irl = _multi_task_irl(settings, "mt_csirl_lt", cs, irl_seed(settings, seed))
            yield from (Transfer(irl, task, chosen.train_targets[0], seed) for task in chosen.train_tasks)


def _figure_2(settings: Settings) -> Iterator[AnyRun]:
    yield from _single_target_curves(settings, FIGURE_TASKS["figure_2"])
    yield from _single_target_scores(settings, "velocity", settings.single_target.tasks[:1])


def _figure_3(settings: Settings) -> Iterator[AnyRun]:
    tasks = settings.multi_task.unseen_tasks
    yield from _experts(settings, tasks, settings.cs_rewards)
    yield from _baselines(settings, tasks)
    yield from _unseen(settings, [m for m in settings.methods if m == "mt_csirl"], settings.cs_rewards)
    yield from _multi_task_scores(settings, "velocity", settings.multi_task.unseen_tasks[:1])


def _judged(settings: Settings) -> Iterator[AnyRun]:
    """What the claims read beside tables and figures: correlations on every task, and C12's generators."""
    for cs in settings.cs_rewards:
        yield from _single_target_scores(settings, cs, settings.single_target.tasks)
        yield from _multi_task_scores(settings, cs, settings.multi_task.unseen_tasks)
    for variant in C12:
        yield from (run for run in _runs(settings, *variant) if isinstance(run, IrlRun))


def _nothing(settings: Settings) -> Iterator[AnyRun]:
    return iter(())


def _curves_of(artefact: str) -> Callable[[Settings], Iterator[AnyRun]]:
    return lambda settings: _single_target_curves(settings, FIGURE_TASKS[artefact])


ARTEFACTS: dict[str, Callable[[Settings], Iterator[AnyRun]]] = {
    "table_1": lambda settings: _cross_transfer(settings, "action_norm"),
    "table_2": _table_2,
    "table_3": lambda settings: _cross_transfer(settings, "velocity"),
    "table_4": _table_4,
    "table_5": _nothing,
    "figure_1": _nothing,
    "figure_2": _figure_2,
    "figure_3": _figure_3,
    "figure_4": _curves_of("figure_4"),
    "figure_5": _curves_of("figure_5"),
    "figure_6": lambda settings: _single_target_scores(settings, "action_norm", settings.single_target.tasks[:1]),
    "figure_7": lambda settings: _multi_task_scores(settings, "action_norm", settings.multi_task.unseen_tasks[:1]),
    "figure_8": _nothing,
    "figure_9": _nothing,
    "figure_s1": _curves_of("figure_s1"),
    "figure_s2": _curves_of("figure_s2"),
}
"""Every artefact, numbered as in the paper, and the runs it reads (not yet what those need in turn)."""


C12 = (("ablation_curriculum", "default"), ("ablation_curriculum", "constant"))
"""The variants of an ablation whose generators claim C12 compares."""
CLAIMS = "claims"


def _runs(settings: Settings, ablation: str, name: str) -> Iterator[AnyRun]:
    """What the variant ``name`` of ``ablation`` shows, with runs of the main study where it changes nothing."""
    chosen, variant = settings.ablations, ABLATIONS[ablation].variants[name]
    anew = ABLATIONS[ablation].agents if variant.agents is None else variant.agents

    def of(agent: str) -> str:
        return f"{ablation}/{name}" if variant.changes and agent in anew else ""

    for task in chosen.tasks:
        for seed in chosen.seeds:
            irl = replace(_single_irl(settings, task, chosen.cs_reward, seed), variant=of("irl"))
            runs: dict[str, AnyRun] = {
                "expert": Expert(chosen.cs_reward, task, EVALUATION_TARGET, seed, of("expert")),
                "irl": irl,
                "transfer": Transfer(irl, task, EVALUATION_TARGET, seed, of("transfer")),
            }
            yield from (runs[agent] for agent in ABLATIONS[ablation].agents)


def variants(settings: Settings, ablation: str) -> dict[str, Runs]:
    """The runs that each variant of an ablation shows, by the variant's name."""
    return {name: _sorted(set[Run[Any]](_runs(settings, ablation, name))) for name in ABLATIONS[ablation].variants}


def design(settings: Settings, artefact: str | None = None) -> Runs:
    """All runs of the study, or those that an artefact or an ablation needs; shared agents appear once."""
    found: set[Run[Any]] = set()
    left: list[Run[Any]] = list(_shown(settings, artefact))
    while left:
        run = left.pop()
        if run not in found:
            found.add(run)
            left.extend(run.needs.values())
    return _sorted(found)


def _shown(settings: Settings, artefact: str | None) -> Iterator[AnyRun]:
    """The runs whose results ``artefact`` shows, not yet what those need in turn."""
    if artefact in ABLATIONS:
        for name in ABLATIONS[artefact].variants:
            yield from _runs(settings, artefact, name)
    elif artefact in ARTEFACTS:
        yield from ARTEFACTS[artefact](settings)
    elif artefact in (None, CLAIMS):
        for runs in (*ARTEFACTS.values(), _judged):
            yield from runs(settings)
    else:
        raise UserError(f"unknown artefact {artefact!r}; allowed: {', '.join((*ARTEFACTS, CLAIMS, *ABLATIONS))}")


Kind = TypeVar("Kind", bound=AnyRun)


def _sorted(found: set[Run[Any]]) -> Runs:
    def of(kind: type[Kind]) -> tuple[Kind, ...]:
        return tuple(sorted(run for run in found if isinstance(run, kind)))

    return Runs(of(Expert), of(Baseline), of(Demonstrations), of(IrlRun), of(Transfer), of(Score))
