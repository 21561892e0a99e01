"""What a machine with many cores, and perhaps a GPU, trains a second: wall time, at most eight minutes.

    make bench-node
    python -m benchmarks.node --device cuda --workers 15

Agents are experts of velocity on reach-wall in lockstep, at the desk scale and with the paper's settings; the share of
the environment is the part of the time in which the learner waits for it. IRL is MT-CSIRL at the desk scale, its steps
those of all T generators together. A scale costs the steps of all agents and generators of its plan over the best rate
measured for them; demonstrations, scores and evaluations are left out.
"""

import argparse
import os
import tempfile
from collections.abc import Callable, Sequence
from pathlib import Path
from time import perf_counter
from typing import Any, NamedTuple

os.environ.setdefault("OMP_NUM_THREADS", "1")

import torch

from mtcsirl.agents.jobs import AgentJob
from mtcsirl.agents.sac import FusedSac
from mtcsirl.agents.training import Training
from mtcsirl.episodes.demonstrations import collect_demonstrations
from mtcsirl.files.provenance import machine
from mtcsirl.files.storage import write_parquet
from mtcsirl.irl import run as irl
from mtcsirl.names import TRAIN_TASKS
from mtcsirl.rewards.adapter import ground_truth
from mtcsirl.settings import Settings
from mtcsirl.settings.loading import load
from mtcsirl.settings.machine import check_device
from mtcsirl.settings.runs import AgentRunSettings, DemonstrationRunSettings, expert_run, irl_run
from mtcsirl.study.design import design
from mtcsirl.study.plan import plan
from mtcsirl.study.rates import load_rates

TASK = "reach-wall"
AGENTS = (1, 16, 64, 256)
TOGETHER = (6, 30)
EPISODE, EPISODES = 100, 2
"""Steps between two looks at the clock, and episodes of each expert that IRL reads."""


class Rate(NamedTuple):
    """Steps of all agents a second, the environment's share of the time, peak memory of the device in MiB."""

    steps: float
    environment: float
    memory: float


def _turns(turn: Callable[[], int], environments: Any, seconds: float) -> Rate:
    """``turn`` again and again for about ``seconds``, twice at least, of which the first is not counted."""
    waited, step = [0.0], environments.step

    def timed(action: Any) -> Any:
        started = perf_counter()
        outcome = step(action)
        waited[0] += perf_counter() - started
        return outcome

    environments.step = timed
    if torch.cuda.is_available():
        torch.cuda.reset_peak_memory_stats()
    started, counted = perf_counter(), 0
    turn()
    begun, waited[0] = perf_counter(), 0.0
    while counted == 0 or perf_counter() - started < seconds:
        counted += turn()
    _wait()
    passed = perf_counter() - begun
    return Rate(counted / passed, waited[0] / passed, _memory())


def _wait() -> None:
    if torch.cuda.is_available():
        torch.cuda.synchronize()


def _memory() -> float:
    """NaN where there is no GPU."""
    return torch.cuda.max_memory_allocated() / 2**20 if torch.cuda.is_available() else float("nan")


def agents(count: int, own: AgentRunSettings, workers: int, seconds: float) -> Rate:
    """Experts in lockstep, past their random steps."""
    f = ground_truth("velocity", own.environment.observation)
    jobs = [AgentJob(TASK, 0, seed, own, "velocity", f, gate="expert") for seed in range(count)]
    training = Training(jobs, workers=workers, log=lambda line: None)

    def turn() -> int:
        before = training.step
        training.episode()
        return (training.step - before) * count

    try:
        return _turns(turn, training.environments, seconds)
    finally:
        training.close()


def agent_settings(settings: Settings, device: str) -> AgentRunSettings:
    """An expert's, with episodes short enough to look at the clock."""
    own = expert_run(settings, TASK, "velocity")
    changes = {"random_steps": EPISODE, "device": device}
    evaluation = own.evaluation.model_copy(update={"episode_steps": EPISODE})
    scripted = {"scripted_steps": 0, "scripted_noise": 0.0, "held_share": 0.0}
    return own.model_copy(
        update={"sac": own.sac.model_copy(update=changes), "evaluation": evaluation, "steps": 40_000, **scripted}
    )


def reward(
    members: Sequence[tuple[str, int]], seconds: float, *, rollout: int = 500, device: str = "cpu", workers: int = 0
) -> Rate:
    """MT-CSIRL on experts that never learned, without warm-up; ``rollout``: steps of an iteration."""
    settings = irl_run(
        load(overrides=[f"sac.device={device}"]), "multi_task", {task for task, _ in members}, "mt_csirl"
    )
    algorithm = settings.irl.model_copy(update={"warm_up_iterations": 0, "steps_per_iteration": rollout})
    changes = {"irl": algorithm, "demonstration_episodes": EPISODES, "scripted_steps": {}, "scripted_noise": 0.0}
    settings = settings.model_copy(update=changes)
    policy = FusedSac(1, settings.sac, seeds=[0], device="cpu").policy(0)
    with tempfile.TemporaryDirectory() as folder:
        files = []
        for task, target in members:
            files.append(Path(folder) / f"{task}-{target}.parquet")
            asked = DemonstrationRunSettings(episodes=EPISODES, episode_steps=rollout)
            frame = collect_demonstrations(policy, task, target, asked, seed=0, cs_reward="velocity")
            write_parquet(files[-1], frame)
        trainer = irl.make_trainer("mt_csirl", "velocity", files, 0, settings, workers=workers)

    def turn() -> int:
        trainer.iterate()
        return rollout * len(members)

    try:
        return _turns(turn, trainer.world.environments, seconds)
    finally:
        trainer.world.environments.close()


def members(count: int) -> list[tuple[str, int]]:
    """Targets of the tasks of section 5.3, task by task."""
    return [(TRAIN_TASKS[index % len(TRAIN_TASKS)], 1 + index // len(TRAIN_TASKS)) for index in range(count)]


def steps_of(settings: Settings) -> tuple[int, int]:
    """Environment steps of all agents of a study, and of all its generators."""
    study = design(settings)
    of_agents = sum(run.settings(settings).steps for run in study.agents)
    generators = 0
    for run in study.irl_runs:
        own = run.settings(settings).irl
        generators += len(run.members) * (own.warm_up_iterations + own.iterations) * own.steps_per_iteration
    return of_agents, generators


def main(arguments: Sequence[str] | None = None) -> None:
    """Measure and print."""
    found = "cuda" if torch.cuda.is_available() else "cpu"
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--device", default=found, help="cpu, cuda or cuda:INDEX; default: a GPU where there is one")
    parser.add_argument("--workers", type=int, default=0, help="processes that step the agents' environments")
    parser.add_argument("--agents", type=int, nargs="+", default=AGENTS, help="agents in lockstep")
    parser.add_argument("--together", type=int, nargs="+", default=TOGETHER, help="generators of an IRL")
    parser.add_argument("--seconds", type=float, default=25.0, help="of each measurement; the default takes 8 minutes")
    parser.add_argument("--rollout", type=int, default=500, help="steps of an IRL iteration")
    asked = parser.parse_args(arguments)
    check_device(asked.device)
    torch.set_num_threads(1)
    scales = {name: load(scale=name) for name in ("desk", "paper")}
    where = "the CPU (a GPU: not measured)" if asked.device == "cpu" else torch.cuda.get_device_name(asked.device)
    print(f"{machine()['processor']}, {machine()['cores']} cores; learner on {where}; {asked.workers} workers")
    best = {}
    for name, settings in scales.items():
        for count in asked.agents if name == "desk" else asked.agents[-2:][:1]:
            rate = agents(count, agent_settings(settings, asked.device), asked.workers, asked.seconds)
            _print(f"{count} agents, {name} scale", rate)
            best[name] = max(best.get(name, 0.0), rate.steps)
    of_irl = {"rollout": asked.rollout, "device": asked.device, "workers": asked.workers}
    generators = {count: reward(members(count), asked.seconds, **of_irl) for count in asked.together}
    for count, rate in generators.items():
        _print(f"IRL of {count} generators, desk scale", rate)
    _print_costs(scales, best, max(rate.steps for rate in generators.values()))


def _print(what: str, rate: Rate) -> None:
    memory = "no GPU" if rate.memory != rate.memory else f"{rate.memory:.0f} MiB of the GPU"
    print(f"{what}: {rate.steps:.0f} steps/s, environment {rate.environment:.0%}, {memory}", flush=True)


def _print_costs(scales: dict[str, Settings], best: dict[str, float], generators: float) -> None:
    rates = load_rates()
    for name, settings in scales.items():
        of_agents, of_generators = steps_of(settings)
        hours = (of_agents / best[name] + of_generators / generators) / 3600
        planned = sum(stage.core_hours for stage in plan(design(settings), settings, rates))
        print(
            f"{name} scale: {of_agents / 1e6:.1f} M agent steps, {of_generators / 1e6:.1f} M generator steps at the"
            f" desk scale's rate: {hours:.1f} hours here in turn; {planned:.0f} core-hours by the shipped rates"
        )


if __name__ == "__main__":
    main()
