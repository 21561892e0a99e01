"""IRL ends in one line when a number is not finite any more, for every method; a diverged simulation has failed."""

import numpy as np
import pytest
import torch

from mtcsirl.agents.finite import NotFiniteError
from mtcsirl.irl.diagnostics import broken_row
from mtcsirl.irl.methods import METHODS
from mtcsirl.irl.run import CHECKPOINT, learn_reward, make_trainer
from tests.irl.conftest import irl_settings


def _settings(discriminator: float | None = None, generator: float | None = None):
    settings = irl_settings(iterations=6, warm_up_iterations=1)
    if discriminator is not None:
        changed = settings.irl.discriminator.model_copy(update={"learning_rate": discriminator})
        settings = settings.model_copy(update={"irl": settings.irl.model_copy(update={"discriminator": changed})})
    if generator is not None:
        rates = dict.fromkeys(("policy_learning_rate", "critic_learning_rate"), generator)
        settings = settings.model_copy(update={"sac": settings.sac.model_copy(update=rates)})
    return settings


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("part", ["discriminator", "generator"])
def test_a_learning_rate_that_explodes_ends_the_run(method, part, demonstrations, tmp_path) -> None:
    with pytest.raises(NotFiniteError) as caught:
        learn_reward(tmp_path, method, "velocity", demonstrations, 100, _settings(**{part: 1e30}))
    line = str(caught.value)
    assert "\n" not in line
    named = "irl.discriminator.learning_rate 1e+30" if part == "discriminator" else "sac.policy_learning_rate 1e+30"
    assert line.startswith(f"{method} s100: ")
    assert "became non-finite in iteration" in line
    assert named in line
    assert {file.name for file in tmp_path.iterdir()} <= {CHECKPOINT}, "no reward, no policy, no rows"


def test_what_a_healthy_run_leaves_is_finite(demonstrations, tmp_path) -> None:
    trainer = make_trainer("mt_csirl", "velocity", demonstrations, 100, _settings())
    for _ in range(3):
        trainer.iterate()
    assert broken_row([*trainer.curve, *trainer.diagnostics]) is None
    correlation, accuracy = ({"metric": name, "value": np.nan} for name in ("pearson_generator", "accuracy_expert"))
    assert broken_row([correlation]) is None
    assert broken_row([correlation, accuracy]) == accuracy


def test_a_generator_whose_simulation_diverges_has_failed_and_starts_over(demonstrations) -> None:
    trainer = make_trainer("mt_csirl", "velocity", demonstrations, 100, _settings())
    simulator = trainer.world.environments.environments[1].simulator
    original = trainer.world.environments.step

    def thrown(action):
        if trainer.replay.size == 80:
            simulator.data.qvel[:] = 1e30
        return original(action)

    trainer.world.environments.step = thrown
    for _ in range(3):
        trainer.iterate()
    marked = [(row["task"], row["step"], row["value"]) for row in trainer.curve if row["metric"] == "diverged"]
    assert marked == [("drawer-close", 120, 1.0)]
    rows = trainer.replay.latest(180)
    assert torch.equal(rows.observation[1, 80], rows.observation[1, 79])
    assert torch.equal(rows.observation[1, 81], torch.from_numpy(trainer.world.environments.reset()[1]))
    success = [row["value"] for row in trainer.curve if (row["metric"], row["task"]) == ("success", "drawer-close")]
    assert success[1] == 0.0


def test_each_generator_draws_from_streams_of_its_own(demonstrations) -> None:
    """The first random actions, minibatches and noise of a generator are those that it has without the other."""
    both, one = (
        make_trainer("mt_csirl", "velocity", files, 100, _settings()) for files in (demonstrations, demonstrations[:1])
    )
    for trainer in (both, one):
        trainer.iterate()  # the warm-up, in which generators share nothing
    for name, tensor in one.sac.state_dict(0).items():
        assert torch.equal(tensor, both.sac.state_dict(0)[name]), name
    for part, alone in zip(both.replay.latest(60), one.replay.latest(60), strict=True):
        assert torch.equal(part[0], alone[0])
    assert not torch.equal(both.replay.latest(60).action[0], both.replay.latest(60).action[1])
