"""Training loops in the middle of their run, made without the run before, and the time that their parts take.

Environments are Meta-World's; what an agent or its experts did before is random numbers, as many as at the desk scale,
so that a minibatch comes from a memory that no cache holds.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Sequence
from time import thread_time
from typing import Any

import torch

from mtcsirl.agents.jobs import AgentJob
from mtcsirl.agents.replay import Replay
from mtcsirl.agents.training import Training
from mtcsirl.episodes.lockstep import make_environments
from mtcsirl.irl.methods import make_method
from mtcsirl.irl.methods.base import Setup
from mtcsirl.irl.rollout import World
from mtcsirl.irl.trainer import IrlTrainer
from mtcsirl.rewards.adapter import ground_truth
from mtcsirl.settings import SacSettings
from mtcsirl.settings.runs import AgentRunSettings, IrlRunSettings
from mtcsirl.transitions import Transitions

REMEMBERED = 30_000
"""Transitions in the memory of each agent."""
CS_REWARD = "velocity"
REPLAY = "drawing and relabelling"


def agents(members: Sequence[tuple[str, int]], sac: SacSettings, episode_steps: int) -> Training:
    """Agents of these (task, target) pairs, past their random actions, their memories full."""
    settings = AgentRunSettings(
        steps=REMEMBERED,
        cs_weight=1.0,
        sac=sac.model_copy(update={"random_steps": 0}),
        evaluation={"episode_steps": episode_steps},
    )
    truth = ground_truth(CS_REWARD, settings.environment.observation)
    jobs = [
        AgentJob(task, target, seed, settings, CS_REWARD, truth, gate="expert")
        for seed, (task, target) in enumerate(members)
    ]
    training = Training(jobs, log=lambda line: None)
    _fill(training.replay, len(members), REMEMBERED)
    return training


def generators(
    members: Sequence[tuple[str, int]], method: str, own: IrlRunSettings, policies: int | None = None
) -> IrlTrainer:
    """The IRL trainer of these (task, target) pairs, past its warm-up, all memories of its discriminators full.

    ``policies``: how many are tabulated; all that the mixture holds, unless a number says otherwise.
    """
    irl = own.irl.model_copy(update={"warm_up_iterations": 0})
    own = own.model_copy(update={"irl": irl, "sac": own.sac.model_copy(update={"random_steps": 0})})
    shown = _transitions(len(members), own.demonstration_episodes * own.evaluation.episode_steps)
    environments = make_environments(members, own.environment, 0)
    truth = ground_truth(CS_REWARD, own.environment.observation)
    world = World(tuple(members), environments, truth, lambda *_: {"task_reward": 0.0})
    setup = Setup(irl, len(members), 0, discount=own.sac.discount)
    trainer = IrlTrainer(make_method(method, setup), world, shown, own, 0)
    _fill(trainer.replay, len(members), irl.generator_replay * irl.steps_per_iteration)
    trainer.start_at(irl.generator_replay)
    mixed = irl.generator_replay if irl.logit_density == "mixture" else 1
    for _ in range(policies or mixed):
        trainer._tabulate(False)
    return trainer


def _fill(replay: Replay, agents: int, count: int) -> None:
    rows = torch.cat([part.view(count, -1) for part in _transitions(1, count)], dim=1)
    for agent in range(agents):
        replay.load_state_dict(agent, {"rows": rows, "counts": torch.tensor([count, 0])})


def _transitions(members: int, count: int) -> Transitions:
    """Random ones [members, count]; actions are inside of their bounds."""
    random = torch.Generator().manual_seed(0)
    observation, following = torch.randn(2, members, count, 39, generator=random)
    action = torch.rand(members, count, 4, generator=random) * 1.8 - 0.9
    return Transitions(observation, action, following, torch.ones(members, count))


def watch_agents(training: Training) -> dict[str, float]:
    """Seconds that the parts of its episodes take from now on, filled as they pass."""
    spent: dict[str, float] = defaultdict(float)
    watch(training.environments, "step", "reset", part="environment", spent=spent)
    watch(training, "_update", part="updates", spent=spent)
    return spent


def watch_generators(trainer: IrlTrainer) -> dict[str, float]:
    """Seconds that the parts of its iterations take from now on, filled as they pass."""
    spent: dict[str, float] = defaultdict(float)
    watch(trainer.sac, "update", part="SAC", spent=spent)
    watch(trainer.world.environments, "step", "reset", part="environment", spent=spent)
    watch(trainer, "_act", "_on_step", part="acting", spent=spent)
    watch(trainer, "_update_discriminators", part="discriminators", spent=spent)
    watch(trainer, "_tabulate", part="log pi", spent=spent)
    watch(trainer.replay, "sample", part=REPLAY, spent=spent)
    watch(trainer, "policy_reward", part=REPLAY, spent=spent)
    return spent


def watch(holder: Any, *names: str, part: str = "", spent: dict[str, float] | None = None) -> dict[str, float]:
    """Seconds that calls of these methods take from now on, under ``part`` in ``spent``."""
    found = defaultdict(float) if spent is None else spent
    for name in names:
        _watch(found, holder, name, part)
    return found


def _watch(spent: dict[str, float], holder: Any, name: str, part: str) -> None:
    inner: Callable[..., Any] = getattr(holder, name)

    def call(*arguments: Any, **named: Any) -> Any:
        started = thread_time()
        try:
            return inner(*arguments, **named)
        finally:
            spent[part] += thread_time() - started

    setattr(holder, name, call)


def seconds(call: Callable[[], Any]) -> float:
    """CPU seconds of this thread."""
    started = thread_time()
    call()
    return thread_time() - started


def members_of(tasks: Sequence[str], count: int) -> list[tuple[str, int]]:
    """``count`` (task, target) pairs: the tasks in turn, then with their next targets."""
    return [(tasks[index % len(tasks)], index // len(tasks)) for index in range(count)]
