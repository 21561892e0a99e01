"""What a run needs of the machine it runs on: a device that is there, memory that suffices.

Not a matter of the configuration alone: the machine that plans a study on a cluster is not the one that trains.

The memory is the least that a run holds at once, so that no run is refused that could have been done. Of a network with
layers of n_0 ... n_L units, W = sum (n_i + 1) n_{i+1} are its weights and U = sum n_i its units; a transition is 83
numbers, s, a, s' and the task reward; a number is 4 bytes. In numbers:

    agent           4 W_actor + 5 C W_critic: weights, gradients, Adam's two moments; of the C critics their targets too
                    + B (83 + 2 U_actor + C U_critic): a minibatch of B; the actor sees both s and s'
                    + 83 M + window: M transitions in the replay memory; the rewards that a curriculum looks at
    IRL             T agents: one per generator
                    + 4 W_f: perceptron or bottleneck
                    + T D 2 B 83: D discriminator updates, drawn all at once, of B expert and B generator transitions
                    + T 83 N: N demonstrated transitions
    demonstrations  83 N: N transitions
    score           3 x 83 N: N transitions of experts, of SAC and of uniform actions
"""

import os
from collections.abc import Iterator, Sequence
from itertools import pairwise

from pydantic import BaseModel

from mtcsirl.errors import UserError
from mtcsirl.settings.configuration import Settings
from mtcsirl.settings.learner import LearnerSettings
from mtcsirl.settings.runs import (
    AgentRunSettings,
    DemonstrationRunSettings,
    IrlRunSettings,
    ScoreRunSettings,
    demonstration_run,
    irl_run,
    score_run,
)

STATE, ACTION, NUMBER = 39, 4, 4
"""Numbers in an observation and in an action; bytes of a number."""
TRANSITION = 2 * STATE + ACTION + 1
TRAINED, WITH_TARGET = 4, 5
"""Numbers per weight that is trained by Adam; of a network that has a target beside it."""
ACTED_SETS = 3
"""Sets of transitions for which a score lets policies act."""
MOST_GIB = 1e9
"""No more is printed: integers of a configuration may be longer than any float."""

Needs = dict[str, int]
"""Numbers that a part of a run holds, by the key that decides how many."""


def check_run(run: BaseModel, generators: int = 1) -> None:
    """Raise UserError, one line, where this machine cannot do the run, an IRL run with so many generators."""
    if isinstance(run, AgentRunSettings):
        check_agent(run)
    elif isinstance(run, IrlRunSettings):
        check_irl(run, generators)
    elif isinstance(run, DemonstrationRunSettings):
        _check_memory(_demonstrations(run, "episodes"))
    elif isinstance(run, ScoreRunSettings):
        _check_memory(_score(run))


def check_agent(run: AgentRunSettings) -> None:
    """Raise UserError, one line, where this machine cannot train the agent."""
    check_device(run.sac.device)
    window = run.curriculum_window if run.curriculum else 0
    _check_memory(_learners(run.sac, 1) | {"steps": TRANSITION * run.steps, "curriculum_window": window})


def check_irl(run: IrlRunSettings, generators: int) -> None:
    """Raise UserError, one line, where this machine cannot run an IRL of so many generators."""
    check_device(run.sac.device)
    _check_memory(_irl(run, generators, "demonstration_episodes"))


def check_study(settings: Settings) -> None:
    """Raise UserError, one line, where this machine cannot do one run of the study, of whatever stage."""
    check_device(settings.sac.device)
    for needs in _of_study(settings):
        _check_memory(needs)


def _of_study(settings: Settings) -> Iterator[Needs]:
    """The largest run of every kind."""
    expert = settings.expert
    windows = {"expert": expert.curriculum_window if expert.curriculum else 0}
    for name in ("expert", "baseline", "transfer"):
        steps = {f"{name}.steps": TRANSITION * max(getattr(settings, name).steps.values())}
        yield _learners(settings.sac, 1) | steps | {f"{name}.curriculum_window": windows.get(name, 0)}
    yield _demonstrations(demonstration_run(settings, settings.cs_rewards[0]), "demonstrations.episodes")
    one, targets, several = settings.single_target, settings.multi_target, settings.multi_task
    kinds = [
        ("single_target", one.tasks, one.method, 1),
        ("multi_target", targets.tasks, targets.method, len(targets.train_targets)),
    ]
    pairs = len(several.train_tasks) * len(several.train_targets)
    kinds += [("multi_task", several.train_tasks, method, pairs) for method in settings.methods]
    for experiment, tasks, method, generators in kinds:
        yield _irl(irl_run(settings, experiment, tasks, method), generators, "demonstrations.episodes")
    yield _score(score_run(settings))


def check_device(device: str) -> None:
    """Raise UserError where a CUDA device is asked for and not there; imports torch only then."""
    if device == "cpu":
        return
    import torch

    index = int(device.partition(":")[2] or 0)
    if index >= torch.cuda.device_count():
        found = f"has {torch.cuda.device_count()} CUDA devices" if torch.cuda.is_available() else "has no CUDA device"
        raise UserError(f"configuration: sac.device = {device!r}: this machine {found}; set it to cpu")


def _check_memory(needs: Needs) -> None:
    """The parts of one process, of which the greatest is named."""
    there = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    needed = NUMBER * sum(needs.values())
    if needed > there:
        name = max(needs, key=lambda part: needs[part])
        gib = MOST_GIB if needed > MOST_GIB * 2**30 else needed / 2**30
        raise UserError(
            f"configuration: {name}: a run would need {gib:,.1f} GiB of memory, this machine has {there / 2**30:,.1f};"
            " make it smaller"
        )


def _learners(sac: LearnerSettings, agents: int) -> Needs:
    """Networks and minibatches; critics beyond the first count as theirs."""
    actor, critic = (STATE, *sac.hidden_sizes, 2 * ACTION), (STATE + ACTION, *sac.hidden_sizes, 1)
    one = WITH_TARGET * _weights(critic)
    return {
        "sac.hidden_sizes": agents * (TRAINED * _weights(actor) + one),
        "sac.critics": agents * (sac.critics - 1) * one,
        "sac.minibatch": agents * sac.minibatch * (TRANSITION + 2 * sum(actor) + sac.critics * sum(critic)),
    }


def _irl(run: IrlRunSettings, generators: int, episodes: str) -> Needs:
    """Generators, f and what it learns from; ``episodes``: the key of the demonstrations."""
    irl, f = run.irl, run.irl.discriminator
    held = min(irl.generator_memory, (irl.iterations + irl.warm_up_iterations) * irl.steps_per_iteration)
    inputs, drawn = 2 * STATE + ACTION, irl.discriminator_updates * 2 * f.minibatch
    encoder = (inputs, *f.bottleneck_hidden_sizes, 2 * f.bottleneck_size)
    shown = run.demonstration_episodes * run.evaluation.episode_steps
    own = {
        "irl.discriminator.hidden_sizes": TRAINED * _weights((inputs, *f.hidden_sizes, 1)),
        "irl.discriminator.bottleneck_hidden_sizes": TRAINED * _weights(encoder[:-1]),
        "irl.discriminator.bottleneck_size": TRAINED * _weights(encoder[-2:]),
        "irl.discriminator.minibatch and irl.discriminator_updates": generators * drawn * TRANSITION,
        "irl.generator_memory": generators * held * TRANSITION,
        "irl.curriculum_window": generators * irl.curriculum_window if irl.curriculum else 0,
        episodes: generators * shown * TRANSITION,
    }
    return _learners(run.sac, generators) | own


def _demonstrations(run: DemonstrationRunSettings, episodes: str) -> Needs:
    return {episodes: run.episodes * run.episode_steps * TRANSITION}


def _score(run: ScoreRunSettings) -> Needs:
    return {"score.transitions": ACTED_SETS * run.score.transitions * TRANSITION}


def _weights(sizes: Sequence[int]) -> int:
    """Weights and biases of a network with layers of these sizes."""
    return sum((before + 1) * after for before, after in pairwise(sizes))
