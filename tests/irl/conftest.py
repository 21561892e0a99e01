"""Two tasks, one short demonstration each, and settings small enough to train in a second."""

from pathlib import Path

import pytest

from mtcsirl.agents.sac import FusedSac
from mtcsirl.episodes.demonstrations import collect_demonstrations
from mtcsirl.files.storage import write_parquet
from mtcsirl.settings import (
    DiscriminatorSettings,
    EvaluationSettings,
    GeneratorSettings,
    IrlSettings,
    LearnerSettings,
    ProgressSettings,
)
from mtcsirl.settings.runs import DemonstrationRunSettings, IrlRunSettings

MEMBERS = (("reach", 1), ("drawer-close", 2))


@pytest.fixture(scope="session")
def demonstrations(tmp_path_factory) -> list[Path]:
    """Files of an untrained policy: what is demonstrated does not matter to these tests."""
    folder = tmp_path_factory.mktemp("demonstrations")
    policy = FusedSac(1, irl_settings().sac, seeds=[7]).policy(0)
    settings = DemonstrationRunSettings(episodes=2, episode_steps=60)
    files = []
    for task, target in MEMBERS:
        files.append(folder / f"{task}.parquet")
        frame = collect_demonstrations(policy, task, target, settings, seed=target, cs_reward="velocity")
        write_parquet(files[-1], frame)
    return files


def irl_settings(**irl) -> IrlRunSettings:
    """Three iterations of 60 steps, one of them warm-up; ``irl`` overrides settings of the algorithm."""
    discriminator = DiscriminatorSettings(hidden_sizes=(16, 16), minibatch=32, learning_rate=1e-3)
    chosen = {
        "iterations": 2,
        "warm_up_iterations": 1,
        "steps_per_iteration": 60,
        "discriminator_updates": 4,
        "generator_updates": 6,
        "generator_replay": 2,
        "centre": True,
        "discriminator": discriminator,
    } | irl
    generators = GeneratorSettings(**{name: chosen.pop(name) for name in GeneratorSettings.model_fields if name in irl})
    settings = IrlSettings(**chosen)
    learner = LearnerSettings(hidden_sizes=(16, 16), minibatch=32, random_steps=30)
    return IrlRunSettings(
        sac=generators.scaling().sac(learner),
        irl=settings,
        demonstration_episodes=2,
        evaluation=EvaluationSettings(episodes=1, episode_steps=60),
        progress=ProgressSettings(checkpoint_every=60),
    )
