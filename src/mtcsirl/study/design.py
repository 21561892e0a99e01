"""What each artefact of the paper needs, as runs of :mod:`mtcsirl.study.runs`."""

from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace

from mtcsirl.errors import UserError
from mtcsirl.names import EVALUATION_TARGET
from mtcsirl.settings import Settings
from mtcsirl.study.ablations import ABLATIONS
from mtcsirl.study.runs import (
    Baseline,
    Demonstrations,
    Expert,
    IrlRun,
    Run,
    Score,
    Study,
    Transfer,
)

FIGURE_TASKS = {
    "figure_2": "reach-wall",
    "figure_4": "button-press-topdown-wall",
    "figure_5": "coffee-button",
    "figure_s1": "drawer-close",
    "figure_s2": "push-back",
}
"""Learning curves of section 5.1; the paper's text and captions disagree on the tasks, so all five exist."""


def _irl_seed(settings: Settings, seed: int) -> int:
    """The seed of the IRL run whose reward the transfer agent of ``seed`` gets."""
    if seed in settings.irl_seeds:
        return seed
    return settings.irl_seeds[settings.seeds.index(seed) % len(settings.irl_seeds)]


def _single_irl(task: str, cs_reward: str, seed: int) -> IrlRun:
    return IrlRun("single_target", "mt_csirl", cs_reward, task, seed, ((task, EVALUATION_TARGET),))


def _multi_target_irl(settings: Settings, task: str, cs_reward: str, seed: int) -> IrlRun:
    members = tuple((task, target) for target in settings.multi_target.train_targets)
    return IrlRun("multi_target", "mt_csirl", cs_reward, task, seed, members)


def _multi_task_irl(settings: Settings, method: str, cs_reward: str, seed: int) -> IrlRun:
    study = settings.multi_task
    members = tuple((task, target) for task in study.train_tasks for target in study.train_targets)
    return IrlRun("multi_task", method, cs_reward, "all", seed, members)


def _baselines(settings: Settings, tasks: Iterable[str]) -> Iterator[Baseline]:
    return (Baseline(task, EVALUATION_TARGET, seed) for task in tasks for seed in settings.seeds)


def _experts(settings: Settings, tasks: Iterable[str], cs_rewards: Iterable[str]) -> Iterator[Expert]:
    tasks = tuple(tasks)
    return (Expert(cs, task, EVALUATION_TARGET, seed) for cs in cs_rewards for task in tasks for seed in settings.seeds)


def _score(settings: Settings, irl: IrlRun, task: str) -> Score:
    expert = Expert(irl.cs_reward, task, EVALUATION_TARGET, settings.seeds[0])
    return Score(irl, task, expert, Baseline(task, EVALUATION_TARGET, settings.seeds[0]))


def _single_target_curves(settings: Settings, task: str) -> Iterator[Run]:
    """Figures 2, 4, 5: IRL agent, Transferred and SAC on the task and target of the expert."""
    if task not in settings.single_target.tasks:
        return
    yield from _baselines(settings, [task])
    for cs in settings.cs_rewards:
        for seed in settings.seeds:
            yield Transfer(_single_irl(task, cs, _irl_seed(settings, seed)), task, EVALUATION_TARGET, seed)


def _single_target_scores(settings: Settings, cs_reward: str) -> Iterator[Run]:
    """Figures 2c and 6: the reward of one task against the truth on that task."""
    task = settings.single_target.tasks[0]
    if cs_reward in settings.cs_rewards:
        for seed in settings.irl_seeds:
            yield _score(settings, _single_irl(task, cs_reward, seed), task)


def _multi_task_scores(settings: Settings, cs_reward: str) -> Iterator[Run]:
    """Figures 3c and 7: the reward of several tasks against the truth on an unseen task."""
    task = settings.multi_task.unseen_tasks[0]
    if cs_reward in settings.cs_rewards and "mt_csirl" in settings.methods:
        for seed in settings.irl_seeds:
            yield _score(settings, _multi_task_irl(settings, "mt_csirl", cs_reward, seed), task)


def _cross_transfer(settings: Settings, cs_reward: str) -> Iterator[Run]:
    """Tables 1 and 3: the reward of each task (several targets) on the new target of every task."""
    tasks = settings.multi_target.tasks
    yield from _baselines(settings, tasks)
    for source in tasks if cs_reward in settings.cs_rewards else ():
        for seed in settings.seeds:
            irl = _multi_target_irl(settings, source, cs_reward, _irl_seed(settings, seed))
            yield from (Transfer(irl, task, EVALUATION_TARGET, seed) for task in tasks)


def _unseen(settings: Settings, methods: Iterable[str], cs_rewards: Iterable[str]) -> Iterator[Run]:
    for method in methods:
        for cs in cs_rewards:
            for seed in settings.seeds:
                irl = _multi_task_irl(settings, method, cs, _irl_seed(settings, seed))
                for task in settings.multi_task.unseen_tasks:
                    yield Transfer(irl, task, EVALUATION_TARGET, seed)


def _table_2(settings: Settings) -> Iterator[Run]:
    yield from _experts(settings, settings.multi_task.unseen_tasks, settings.cs_rewards)
    yield from _baselines(settings, settings.multi_task.unseen_tasks)
    yield from _unseen(settings, settings.methods, settings.cs_rewards)


def _table_4(settings: Settings) -> Iterator[Run]:
    """MT-CSIRL+LT: both learned rewards, new agents on tasks and targets that the IRL has seen."""
    if "mt_csirl_lt" not in settings.methods:
        return
    study = settings.multi_task
    for cs in settings.cs_rewards:
        for seed in settings.seeds:
            irl = _multi_task_irl(settings, "mt_csirl_lt", cs, _irl_seed(settings, seed))
            yield from (Transfer(irl, task, study.train_targets[0], seed) for task in study.train_tasks)


def _figure_2(settings: Settings) -> Iterator[Run]:
    yield from _single_target_curves(settings, FIGURE_TASKS["figure_2"])
    yield from _single_target_scores(settings, "velocity")


def _figure_3(settings: Settings) -> Iterator[Run]:
    tasks = settings.multi_task.unseen_tasks
    yield from _experts(settings, tasks, settings.cs_rewards)
    yield from _baselines(settings, tasks)
    yield from _unseen(settings, [m for m in settings.methods if m == "mt_csirl"], settings.cs_rewards)
    yield from _multi_task_scores(settings, "velocity")


def _nothing(settings: Settings) -> Iterator[Run]:
    return iter(())


def _curves_of(artefact: str) -> Callable[[Settings], Iterator[Run]]:
    return lambda settings: _single_target_curves(settings, FIGURE_TASKS[artefact])


ARTEFACTS: dict[str, Callable[[Settings], Iterator[Run]]] = {
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
    "figure_6": lambda settings: _single_target_scores(settings, "action_norm"),
    "figure_7": lambda settings: _multi_task_scores(settings, "action_norm"),
    "figure_8": _nothing,
    "figure_9": _nothing,
    "figure_s1": _curves_of("figure_s1"),
    "figure_s2": _curves_of("figure_s2"),
}
"""Every artefact, numbered as in the paper, and the runs it reads (not yet what those need in turn)."""


def _needs(settings: Settings, run: Run) -> Iterator[Run]:
    """The runs that ``run`` reads."""
    if isinstance(run, Transfer):
        yield run.irl
    elif isinstance(run, Score):
        yield from (run.irl, run.expert, run.baseline)
    elif isinstance(run, IrlRun):
        for task, target in run.members:
            expert = Expert(run.cs_reward, task, target, settings.seeds[0])
            yield Demonstrations(run.cs_reward, task, target, expert, (run.experiment,))
    elif isinstance(run, Demonstrations):
        yield run.expert


def _readers(settings: Settings) -> dict[Demonstrations, tuple[str, ...]]:
    """Which experiments read each demonstration set, over the whole study, whatever artefact was asked for."""
    readers: dict[Demonstrations, set[str]] = {}
    shown = [run for rule in ARTEFACTS.values() for run in rule(settings)]
    shown += [
        run for name, ablation in ABLATIONS.items() for v in ablation.variants for run in _runs(settings, name, v)
    ]
    for irl in {run.irl if isinstance(run, Transfer | Score) else run for run in shown}:
        for demonstrations in _needs(settings, irl) if isinstance(irl, IrlRun) else ():
            readers.setdefault(demonstrations, set()).add(irl.experiment)  # type: ignore[arg-type, union-attr]
    return {demonstrations: tuple(sorted(names)) for demonstrations, names in readers.items()}


def _runs(settings: Settings, ablation: str, name: str) -> Iterator[Run]:
    """What the variant ``name`` of ``ablation`` shows, with runs of the main study where it changes nothing."""
    chosen, variant = settings.ablations, ABLATIONS[ablation].variants[name]
    anew = ABLATIONS[ablation].agents if variant.agents is None else variant.agents

    def of(agent: str) -> str:
        return f"{ablation}/{name}" if variant.changes and agent in anew else ""

    for task in chosen.tasks:
        for seed in chosen.seeds:
            irl = replace(_single_irl(task, chosen.cs_reward, seed), variant=of("irl"))
            runs: dict[str, Run] = {
                "expert": Expert(chosen.cs_reward, task, EVALUATION_TARGET, seed, of("expert")),
                "irl": irl,
                "transfer": Transfer(irl, task, EVALUATION_TARGET, seed, of("transfer")),
            }
            yield from (runs[agent] for agent in ABLATIONS[ablation].agents)


def variants(settings: Settings, ablation: str) -> dict[str, Study]:
    """The runs that each variant of an ablation shows, by the variant's name."""
    return {name: _study(set(_runs(settings, ablation, name)), {}) for name in ABLATIONS[ablation].variants}


def design(settings: Settings, artefact: str | None = None) -> Study:
    """All runs of the study, or those that an artefact or an ablation needs; shared agents appear once."""
    if artefact in ABLATIONS:
        open_runs = [run for name in ABLATIONS[artefact].variants for run in _runs(settings, artefact, name)]
    elif artefact is None or artefact in ARTEFACTS:
        open_runs = [run for name in ([artefact] if artefact else ARTEFACTS) for run in ARTEFACTS[name](settings)]
    else:
        raise UserError(f"unknown artefact {artefact!r}; allowed: {', '.join((*ARTEFACTS, *ABLATIONS))}")
    found: set[Run] = set()
    while open_runs:
        run = open_runs.pop()
        if run not in found:
            found.add(run)
            open_runs.extend(_needs(settings, run))
    return _study(found, _readers(settings))


def _study(found: set[Run], readers: dict[Demonstrations, tuple[str, ...]]) -> Study:
    def of(kind: type) -> tuple:
        return tuple(sorted(run for run in found if isinstance(run, kind)))

    demonstrations = tuple(replace(run, experiments=readers[run]) for run in of(Demonstrations))
    return Study(of(Expert), of(Baseline), demonstrations, of(IrlRun), of(Transfer), of(Score))
