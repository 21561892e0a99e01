"""log pi of mixtures against the mean of densities, however the tables came about."""

import math

import pytest
import torch

from mtcsirl.agents.sac import FusedSac
from mtcsirl.irl.densities import Densities
from mtcsirl.settings import LearnerSettings, RewardScaleSettings
from mtcsirl.transitions import Transitions

TASKS, STEPS, OBSERVATION, ACTION = 2, 7, 5, 3
SAC = RewardScaleSettings().sac(LearnerSettings(hidden_sizes=(8, 8)))


def _sac(seed: int) -> FusedSac:
    sac = FusedSac(TASKS, SAC, seeds=[seed, seed + 50], observation_size=OBSERVATION, action_size=ACTION)
    sac.actor.parameters.mul_(1.5)
    return sac


def _transitions(count: int, seed: int) -> Transitions:
    random = torch.Generator().manual_seed(seed)
    draw = [torch.randn(TASKS, count, size, generator=random) for size in (OBSERVATION, ACTION, OBSERVATION)]
    return Transitions(draw[0], draw[1].tanh(), draw[2], torch.zeros(TASKS, count))


def _joined(rollouts: list[Transitions]) -> Transitions:
    return Transitions(*(torch.cat(parts, dim=1) for parts in zip(*rollouts, strict=True)))


def _fill(policies: int, rollouts: int, made: Densities | None = None) -> tuple[Densities, Transitions]:
    demonstrations = _transitions(1_100, 99)
    densities = made or Densities(demonstrations, SAC, policies, STEPS)
    seen: list[Transitions] = []
    for number in range(rollouts):
        seen.append(_transitions(STEPS, number))
        sac = _sac(number)
        densities.add([sac.policy(task) for task in range(TASKS)], _joined(seen[-policies:]))
    return densities, _joined(seen[-policies:])


@pytest.mark.parametrize("rollouts", [1, 2, 3, 5])
def test_tables_are_the_log_of_the_mean_density_of_the_last_policies(rollouts) -> None:
    densities, window = _fill(3, rollouts)
    last = [_sac(number) for number in range(rollouts)][-3:]
    for found, held in ((densities.generator(), window), (densities.expert(), _transitions(1_100, 99))):
        expected = (
            torch.stack([sac.log_prob(held.observation, held.action) for sac in last])
            .double()
            .exp()
            .mean(0)
            .log()
            .float()
        )
        torch.testing.assert_close(found, expected, rtol=1e-4, atol=1e-3)


def test_uniform_actions_have_a_density_too() -> None:
    densities = Densities(_transitions(4, 0), SAC, 2, STEPS)
    first, second = _transitions(STEPS, 1), _transitions(STEPS, 2)
    densities.add(None, first)
    assert densities.expert()[0, 0].item() == pytest.approx(-ACTION * math.log(2))
    sac = _sac(1)
    densities.add([sac.policy(task) for task in range(TASKS)], _joined([first, second]))
    own = sac.log_prob(first.observation, first.action).exp()
    torch.testing.assert_close(densities.generator()[:, :STEPS], ((own + 2.0**-ACTION) / 2).log(), rtol=1e-4, atol=1e-4)


def test_state_restores_everything() -> None:
    first, _ = _fill(3, 4)
    again = Densities(_transitions(1_100, 99), SAC, 3, STEPS)
    again.load_state({name: tensor.clone() for name, tensor in first.state().items()})
    for densities in (first, again):
        sac = _sac(9)
        window = _joined([_transitions(STEPS, number) for number in (2, 3, 9)])
        densities.add([sac.policy(task) for task in range(TASKS)], window)
    assert torch.equal(first.generator(), again.generator())
    assert torch.equal(first.expert(), again.expert())
