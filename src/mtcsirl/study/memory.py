"""Memory that a job holds at most, in MiB: what the plan prints and the workflow asks for.

Measured with everything full, a checkpoint written and taken up, and the results written (``python -m
benchmarks.memory``, docs/performance.md). It is the same on every machine, so it is no part of its rates.
"""

from __future__ import annotations

from itertools import pairwise

from mtcsirl.settings import SacSettings
from mtcsirl.settings.runs import AgentRunSettings, IrlRunSettings

BYTES_PER_TRANSITION = 4 * (39 + 4 + 39 + 1)
MIB = 2**20
BASE = 420.0
"""Of a job with one environment, before it holds anything."""
AGENT, GENERATOR = 22.0, 44.0
"""An environment, streams of random numbers and layers' outputs; of a generator also what discriminators see of it."""
FRAMES = 85.0
"""What reading and writing frames takes beside the frames themselves."""
IN_A_FRAME = 3.6
"""Times that a transition's numbers are held while a frame of them is made and written, as objects and as columns."""
RECORDED, READ = 6.0, 2.0
"""Times that demonstrations are held while they are recorded, and once they are read."""
SCORING, SCORED = 220.0, 3.6
"""What a score takes beside the generators' samples, and times that these are held."""
SAMPLED_ROLLOUTS = 10
"""Last rollouts of a generator that an IRL run leaves, and that a score reads."""


def agent_memory(own: AgentRunSettings, agents: int = 1) -> float:
    """``agents`` that train in lockstep. At most when a checkpoint is taken up: the replay memory is there twice."""
    return BASE + agents * (AGENT + _networks(own.sac) + 2 * _transitions(own.steps))


def demonstrations_memory(steps: int) -> float:
    """``steps`` transitions recorded step by step and written as a frame."""
    return BASE + FRAMES + RECORDED * _transitions(steps)


def irl_memory(own: IrlRunSettings, generators: int) -> float:
    """An IRL run: at most when a checkpoint is taken up, or when the samples that it leaves are written."""
    irl = own.irl
    steps = (irl.warm_up_iterations + irl.iterations) * irl.steps_per_iteration
    held = _transitions(min(steps, irl.generator_memory))
    seen = _transitions(min(irl.generator_replay * irl.steps_per_iteration, irl.generator_memory))
    shown = READ * _transitions(own.demonstration_episodes * own.evaluation.episode_steps)
    written = IN_A_FRAME * sampled(own)
    return BASE + FRAMES + generators * (GENERATOR + _networks(own.sac) + held + seen + shown + max(held, written))


def score_memory(own: IrlRunSettings, generators: int) -> float:
    """A score reads the samples of the IRL run ``own``."""
    return BASE + SCORING + generators * SCORED * sampled(own)


def sampled(own: IrlRunSettings) -> float:
    """The numbers of a generator's transitions that an IRL run leaves."""
    irl = own.irl
    steps = (irl.warm_up_iterations + irl.iterations) * irl.steps_per_iteration
    return _transitions(min(SAMPLED_ROLLOUTS * irl.steps_per_iteration, irl.generator_memory, steps))


def weights(inputs: int, hidden: tuple[int, ...], outputs: int) -> int:
    """Weights of a network, without biases."""
    return sum(first * second for first, second in pairwise((inputs, *hidden, outputs)))


def _networks(sac: SacSettings) -> float:
    """Parameters, gradients and Adam's two moments of the actor and of each critic, and the critics' targets."""
    actor, critic = weights(39, sac.hidden_sizes, 8), weights(43, sac.hidden_sizes, 1)
    return 4 * (4 * actor + 5 * sac.critics * critic) / MIB


def _transitions(count: int) -> float:
    return count * BYTES_PER_TRANSITION / MIB
