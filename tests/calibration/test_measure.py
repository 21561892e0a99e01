"""What this machine trains in a second, measured in little."""

import pytest
import torch

from mtcsirl.calibration import loops, measure
from mtcsirl.settings import SacSettings, Settings
from mtcsirl.settings.runs import irl_run
from mtcsirl.study.design import design
from mtcsirl.study.plan import plan
from mtcsirl.study.rates import DEFAULT

TASKS = ("reach", "drawer-close")
MEMBERS = [("reach", 0), ("drawer-close", 0)]


def test_members_are_the_tasks_in_turn_then_their_next_targets() -> None:
    assert loops.members_of(TASKS, 3) == [("reach", 0), ("drawer-close", 0), ("reach", 1)]


def test_the_parts_of_an_episode_are_parts_of_it() -> None:
    training = loops.agents(MEMBERS, SacSettings(minibatch=8), 40)
    spent = loops.watch_agents(training)
    whole = loops.seconds(training.episode)
    training.close()
    assert set(spent) == {"environment", "updates"}
    assert 0 < sum(spent.values()) < whole
    assert training.learner.updates == 20, "past its random actions from the first step on"


def test_an_irl_run_is_in_its_middle() -> None:
    """As many policies are tabulated and as much is remembered as when it has long gone on, and all of it trains."""
    own = irl_run(Settings(), "multi_task", TASKS)
    few = {"generator_updates": 2, "discriminator_updates": 2, "generator_replay": 3}
    own = own.model_copy(update={"irl": own.irl.model_copy(update=few)})
    trainer = loops.generators(MEMBERS, "mt_csirl", own)
    spent = loops.watch_generators(trainer)
    before = [trainer.densities.generator().shape, trainer.densities.state()["actors"].shape]
    whole = loops.seconds(trainer.iterate)
    trainer.world.environments.close()
    assert [trainer.densities.generator().shape, trainer.densities.state()["actors"].shape] == before
    assert before[0] == (2, 3 * own.irl.steps_per_iteration)
    assert set(spent) == {"SAC", "environment", "acting", "discriminators", "log pi", loops.REPLAY}
    assert 0 < sum(spent.values()) < whole


@pytest.mark.slow
def test_a_calibration_in_little_is_one_that_a_plan_can_use(monkeypatch: pytest.MonkeyPatch) -> None:
    methods = ("mt_csirl", "mt_csirl_lt")
    small = {"TASKS": TASKS, "MINIBATCHES": (8,), "METHODS": methods, "AGENTS": (2,), "GENERATORS": (1,), "PASSES": 1}
    for name, value in small.items():
        monkeypatch.setattr(measure, name, value)
    rates = measure.calibrate()
    assert torch.get_num_threads() == 1
    assert set(rates.environment_step) == {DEFAULT, *TASKS}
    assert (set(rates.agents), set(rates.generators)) == ({2}, {1})
    generator = rates.generators[1]
    assert set(generator.update) == {8}
    assert set(generator.discriminator_update) == {DEFAULT, *methods}
    assert generator.discriminator_update["mt_csirl_lt"][8] > generator.discriminator_update["mt_csirl"][8], (
        "it has two"
    )
    settings = Settings()
    assert all(stage.core_hours > 0 for stage in plan(design(settings), settings, rates))


def test_the_median_of_passes_has_three_digits() -> None:
    passes = [{"step": {8: value}} for value in (0.012345, 0.5, 0.000123456)]
    assert measure._medians(passes) == {"step": {8: 0.0123}}
