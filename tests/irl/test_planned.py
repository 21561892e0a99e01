"""What the plan counts of an IRL run, held against a run."""

import pytest

from mtcsirl.irl.run import make_trainer
from mtcsirl.irl.trainer import IrlTrainer
from mtcsirl.study.plan import discriminating_iterations, tabulated
from tests.irl.conftest import irl_settings


def counted(trainer: IrlTrainer, monkeypatch: pytest.MonkeyPatch) -> dict[str, int]:
    """Transitions of each generator that a whole run tabulates, and iterations in which its discriminators learn."""
    found = {"tabulated": 0, "iterations": 0}
    density, update = trainer.densities._log_density, trainer._update_discriminators

    def tabulating(parameters, transitions):
        found["tabulated"] += transitions.task_reward.shape[1]
        return density(parameters, transitions)

    def updating():
        found["iterations"] += 1
        return update()

    monkeypatch.setattr(trainer.densities, "_log_density", tabulating)
    monkeypatch.setattr(trainer, "_update_discriminators", updating)
    for _ in range(trainer.iterations):
        trainer.iterate()
    return found


@pytest.mark.parametrize("method", ["mt_csirl", "mt_airl", "mt_csirl_lt"])
@pytest.mark.parametrize(
    "irl",
    [
        {"iterations": 4, "warm_up_iterations": 0, "generator_replay": 2},
        {"iterations": 3, "warm_up_iterations": 3, "generator_replay": 3},
        {"iterations": 2, "warm_up_iterations": 4, "generator_replay": 1},
        {"iterations": 3, "warm_up_iterations": 1, "generator_replay": 2, "logit_density": "as_printed"},
    ],
)
def test_the_plan_counts_what_a_run_does(
    method: str, irl: dict[str, int], demonstrations, monkeypatch: pytest.MonkeyPatch
) -> None:
    own = irl_settings(**irl)
    done = counted(make_trainer(method, "velocity", demonstrations, 100, own), monkeypatch)
    planned = discriminating_iterations(own, method)
    assert done == {"tabulated": tabulated(own, planned), "iterations": planned}
