"""D_updates and G_updates: the paper has its own for each experiment, and does not say what one update is."""

from pathlib import Path
from typing import Any

import pytest

from mtcsirl.errors import UserError
from mtcsirl.settings import Settings
from mtcsirl.settings.budgets import EXPERIMENTS
from mtcsirl.settings.irl import IrlSettings
from mtcsirl.settings.loading import load, read_yaml, validate
from mtcsirl.settings.runs import irl_run
from mtcsirl.settings.template import deviations

KEYS = ("discriminator_updates", "generator_updates")


def run(settings: Settings, experiment: str) -> IrlSettings:
    return irl_run(settings, experiment, ["reach"]).irl


@pytest.mark.parametrize("experiment", EXPERIMENTS)
@pytest.mark.parametrize("name", KEYS)
def test_paper_scale_has_the_published_number_of_each_experiment(checkout: Path, experiment: str, name: str) -> None:
    published = read_yaml(checkout / "src/mtcsirl/results/published.yaml")["irl_settings"]
    assert getattr(load(scale="paper").irl, name)[experiment] == published[experiment][name]


def test_one_number_for_all_experiments_deviates_from_the_paper() -> None:
    """15 and 15 everywhere was taken for the paper's once; its several tasks have 10 and 20."""
    settings = load(scale="paper", overrides=["irl.discriminator_updates.multi_task=15", "scale=desk"])
    (deviation,) = deviations(settings)
    assert deviation.key == "irl.discriminator_updates"
    with pytest.raises(UserError, match=r"scale = 'paper', but irl\.discriminator_updates = "):
        load(scale="paper", overrides=["irl.discriminator_updates.multi_task=15"])
    assert "multi_task: 15} updates (paper: {single_target: 15, multi_target: 15, multi_task: 10})" in str(deviation)


@pytest.mark.parametrize("experiment", EXPERIMENTS)
def test_desk_scale_counts_gradient_steps(experiment: str) -> None:
    irl = run(Settings(), experiment)
    assert (irl.discriminator_updates, irl.generator_updates, irl.steps_per_iteration) == (40, 250, 500)


def test_each_experiment_has_its_own() -> None:
    settings = load(overrides=["irl.discriminator_updates.multi_task=7", "irl.generator_updates.single_target=9"])
    found = {
        name: (run(settings, name).discriminator_updates, run(settings, name).generator_updates) for name in EXPERIMENTS
    }
    assert found == {"single_target": (40, 9), "multi_target": (40, 250), "multi_task": (7, 250)}


@pytest.mark.parametrize(
    ("experiment", "discriminator", "generator"), [("single_target", 15, 7500), ("multi_task", 10, 10_000)]
)
def test_an_epoch_is_a_rollout_and_a_gradient_step_for_each_of_its_steps(
    experiment: str, discriminator: int, generator: int
) -> None:
    irl = run(load(scale="paper"), experiment)
    assert irl.discriminator_updates == discriminator
    assert irl.generator_updates == irl.steps_per_iteration == generator


def test_generators_get_the_budget_of_plain_sac_at_paper_scale() -> None:
    """Read as gradient steps they got 7,500 of SAC's 250,000: no test of the paper's algorithm."""
    settings = load(scale="paper")
    irl = run(settings, "single_target")
    assert irl.iterations * irl.generator_updates == pytest.approx(settings.baseline.steps["default"], rel=0.02)
    literal = run(load(scale="paper", overrides=["irl.generator_update=gradient_step"]), "single_target")
    assert (literal.generator_updates, literal.steps_per_iteration) == (15, 500)


def test_discriminator_epochs_do_not_change_what_is_collected() -> None:
    irl = run(load(overrides=["irl.discriminator_update=epoch"]), "multi_task")
    assert (irl.discriminator_updates, irl.generator_updates, irl.steps_per_iteration) == (20_000, 250, 500)


WRONG: list[tuple[Any, str]] = [
    (15, "irl.{} = 15: must be a mapping of keys to values"),
    ({"multi_task": 3}, "irl.{}: needs exactly the keys single_target, multi_target, multi_task"),
    ({**dict.fromkeys(EXPERIMENTS, 3), "default": 3}, "irl.{}: needs exactly the keys single_target, "),
    ({**dict.fromkeys(EXPERIMENTS, 3), "multi_task": 0}, "irl.{}.multi_task = 0: must be greater than 0"),
]


@pytest.mark.parametrize("name", KEYS)
@pytest.mark.parametrize(("value", "says"), WRONG)
def test_anything_else_is_one_line(name: str, value: Any, says: str) -> None:
    with pytest.raises(UserError) as caught:
        validate(Settings, {"irl": {name: value}})
    assert says.format(name) in str(caught.value)
    assert "\n" not in str(caught.value)
