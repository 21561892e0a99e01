"""Measures the rates of this machine that :mod:`mtcsirl.study.plan` computes costs from. One thread, about two minutes.

CPU seconds, so that what else the machine does shifts them little; it should do little all the same.
"""

import resource
import statistics
import subprocess
import sys
import time
from collections.abc import Callable

import numpy as np
import torch

from mtcsirl.agents.sac import FusedSac
from mtcsirl.files.provenance import machine
from mtcsirl.irl.discriminator import Batch
from mtcsirl.irl.methods import make_method
from mtcsirl.irl.methods.base import Setup
from mtcsirl.names import SINGLE_TASKS, TRAIN_TASKS
from mtcsirl.settings import IrlSettings, SacSettings
from mtcsirl.settings.loading import validate
from mtcsirl.study.plan import Rates
from mtcsirl.transitions import Transitions
from mtcsirl.worlds.environments import make_environment

MINIBATCHES = (64, 128, 256, 500)
STEPS = 1000
UPDATES = 40
TOGETHER = 6
"""Generators of the multi-task experiment at desk scale."""
START = (
    "from mtcsirl.stages import train_sac; from mtcsirl.worlds.environments import make_environment;"
    " make_environment('reach', 0)"
)
"""What a job does before it trains: imports its stage, makes its environment."""
LOAD = "from mtcsirl.study.calibration import sac_update; import torch; torch.set_num_threads(1); print(sac_update(64))"


def calibrate() -> Rates:
    """All rates of this machine.

    Raises:
        UserError: one of them cannot be, such as 0 seconds.
    """
    torch.set_num_threads(1)
    steps = {task: environment_step(task) for task in dict.fromkeys((*SINGLE_TASKS, *TRAIN_TASKS))}
    found = machine()
    rates = {
        "machine": f"{found['processor']}, {found['cores']} cores",
        "start_up": _start_up(),
        "environment_step": {"default": round(statistics.median(steps.values()), 7), **steps},
        "action": _seconds(_acting(), 200),
        "sac_update": {size: sac_update(size) for size in MINIBATCHES},
        "lockstep": _lockstep(SacSettings().minibatch),
        "discriminator_update": {size: _discriminator_update(size) for size in MINIBATCHES},
        "slowdown": _slowdown(2),
        "base_memory_mib": 420,
        "agent_disk_mib": 0.6,
        "bootstrap": 0.002,
    }
    return validate(Rates, rates)


def environment_step(task: str) -> float:
    """Seconds per step of ``task`` under random actions, resets included."""
    environment = make_environment(task, 0)
    actions = np.random.default_rng(0).uniform(-1, 1, (STEPS, 4)).astype(np.float32)
    start = time.thread_time()
    for index, action in enumerate(actions):
        if index % 500 == 0:
            environment.reset()
        environment.step(action)
    seconds = (time.thread_time() - start) / STEPS
    environment.close()
    return round(seconds, 7)


def sac_update(minibatch: int, agents: int = 1) -> float:
    """Seconds per gradient step of so many agents together at the desk scale's network sizes."""
    sac = FusedSac(agents, SacSettings(minibatch=minibatch), seeds=range(agents))
    batch = _transitions(minibatch, agents)
    return _seconds(
        lambda: sac.update(batch.observation, batch.action, batch.task_reward, batch.next_observation), UPDATES
    )


def _lockstep(minibatch: int) -> float:
    return round(sac_update(minibatch, TOGETHER) / (TOGETHER * sac_update(minibatch)), 2)


def _discriminator_update(minibatch: int) -> float:
    method = make_method("mt_csirl", Setup(irl=IrlSettings(), tasks=1, seed=0))
    (discriminator,) = method.discriminators.values()
    side, log_pi = _transitions(minibatch), torch.zeros(1, minibatch)
    batch = Batch(side, side, log_pi, log_pi, torch.ones(1, 1))
    return _seconds(lambda: discriminator.update(batch), UPDATES)


def _acting() -> Callable[[], object]:
    sac = FusedSac(1, SacSettings(), seeds=(0,))
    observation = torch.zeros(1, 39)
    return lambda: sac.act(observation).numpy()


def _transitions(minibatch: int, agents: int = 1) -> Transitions:
    random = torch.Generator().manual_seed(0)
    observation = torch.randn(agents, minibatch, 39, generator=random)
    action = torch.rand(agents, minibatch, 4, generator=random) * 1.8 - 0.9
    return Transitions(observation, action, observation.flip(1), torch.zeros(agents, minibatch))


def _seconds(run: Callable[[], object], times: int) -> float:
    """Median seconds of ``run`` after a few to warm up."""
    for _ in range(5):
        run()
    taken = []
    for _ in range(times):
        start = time.thread_time()
        run()
        taken.append(time.thread_time() - start)
    return round(statistics.median(taken), 7)


def _start_up() -> float:
    def spent() -> float:
        children = resource.getrusage(resource.RUSAGE_CHILDREN)
        return children.ru_utime + children.ru_stime

    before = spent()
    subprocess.run([sys.executable, "-c", START], check=True)
    return round(spent() - before, 3)


def _slowdown(jobs: int) -> float:
    """How much slower one of ``jobs`` simultaneous learners is than a lone one."""

    def together(count: int) -> float:
        running = [
            subprocess.Popen([sys.executable, "-c", LOAD], stdout=subprocess.PIPE, text=True) for _ in range(count)
        ]
        return statistics.mean(float(job.communicate()[0]) for job in running)

    return round(max(1.0, together(jobs) / together(1)), 2)
