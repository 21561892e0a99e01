"""Agent steps per second, end to end, against stock stable-baselines3 on stock Meta-World.

    python -m benchmarks.agent_steps             the table
    python -m benchmarks.agent_steps --profile   then, where the time of our steps goes

An agent step is one environment step with all that training pays for it: the policy's action, the replay memory, half a
gradient update (the desk scale) and, on our side only, relabelling with the expert's velocity reward
and the metrics of the learning curve. Both take turns of one episode in one thread, timed in CPU seconds of that
thread.
"""

import cProfile
import os
import pstats
from collections.abc import Callable, Iterator
from importlib.metadata import version
from time import thread_time

os.environ.setdefault("OMP_NUM_THREADS", "1")

from stable_baselines3 import SAC

from benchmarks.sides import Row, command, row, seconds
from mtcsirl.agents.jobs import AgentJob
from mtcsirl.agents.training import Training
from mtcsirl.rewards.adapter import ground_truth
from mtcsirl.settings.runs import AgentRunSettings
from mtcsirl.worlds.fast.identity import stock_environment

TASKS = ("reach-wall", "push-back")
EPISODE_STEPS = 500
RANDOM_STEPS = 500


def measure(rounds: int = 5, tasks: tuple[str, ...] = TASKS) -> Iterator[Row]:
    """Rows of agent steps a second, one per task."""
    peer = f"stable-baselines3 {version('stable-baselines3')} on metaworld {version('metaworld')}"
    for task in tasks:
        settings = _settings(rounds)
        both = (_ours(task, settings), _theirs(task, settings))
        for episode in both:  # the random steps, without updates
            episode()
        times = [[seconds(episode) for episode in both] for _ in range(rounds)]
        setting = f"{task}, minibatch {settings.sac.minibatch}, an update every 2 steps"
        yield row("agent_steps", setting, peer, times, EPISODE_STEPS)


def _settings(rounds: int) -> AgentRunSettings:
    return AgentRunSettings(
        steps=(rounds + 1) * EPISODE_STEPS,
        cs_weight=1.0,
        curriculum=True,
        sac={"random_steps": RANDOM_STEPS},
    )


def _ours(task: str, settings: AgentRunSettings) -> Callable[[], None]:
    f = ground_truth("velocity", settings.environment.observation)
    job = AgentJob(task, 0, 0, settings, "velocity", f, gate="expert")
    return Training([job], log=lambda line: None).episode


def _theirs(task: str, settings: AgentRunSettings) -> Callable[[], None]:
    model = SAC(
        "MlpPolicy",
        stock_environment(task, 0),
        learning_rate=settings.sac.critic_learning_rate,
        buffer_size=settings.steps,
        learning_starts=RANDOM_STEPS,
        batch_size=settings.sac.minibatch,
        train_freq=2,
        gradient_steps=1,
        policy_kwargs={"net_arch": list(settings.sac.hidden_sizes)},
        seed=0,
        device="cpu",
    )

    def episode() -> None:
        model.learn(EPISODE_STEPS, reset_num_timesteps=False)

    return episode


def profile(task: str = TASKS[0]) -> None:
    """Print the functions of our loop by the time they spend."""
    episode = _ours(task, _settings(2))
    episode()
    recorder = cProfile.Profile(thread_time)
    recorder.runcall(episode)
    pstats.Stats(recorder).sort_stats("cumulative").print_stats("mtcsirl", 25)


if __name__ == "__main__":
    command(__doc__, measure, profile)
