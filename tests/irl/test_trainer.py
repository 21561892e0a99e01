"""Algorithms 1 and 2 at toy size."""

import copy
import json

import numpy as np
import pandas as pd
import pytest
import torch

from mtcsirl.episodes.lockstep import Outcome
from mtcsirl.errors import UserError
from mtcsirl.files.checkpoint import save_checkpoint
from mtcsirl.files.storage import checksum
from mtcsirl.irl.methods import METHODS, make_method
from mtcsirl.irl.methods.base import Setup
from mtcsirl.irl.resume import load_state, state
from mtcsirl.irl.rollout import collect
from mtcsirl.irl.run import CHECKPOINT, learn_reward, make_trainer
from mtcsirl.irl.trainer import IrlTrainer
from mtcsirl.names import CURVE_COLUMNS, DIAGNOSTIC_COLUMNS
from mtcsirl.rewards.learned import load_learned_reward
from mtcsirl.transitions import Transitions
from tests.irl.conftest import MEMBERS, irl_settings

FILES = ("reward.safetensors", "curve.csv", "diagnostics.csv", "evaluation.csv", "gate.json", "samples.parquet")


def _trainer(method: str, demonstrations, **irl) -> IrlTrainer:
    return make_trainer(method, "velocity", demonstrations, 100, irl_settings(**irl))


def _run(trainer: IrlTrainer, iterations: int | None = None) -> IrlTrainer:
    for _ in range(iterations or trainer.iterations):
        trainer.iterate()
    return trainer


@pytest.mark.parametrize("method", METHODS)
def test_every_method_trains_and_leaves_a_whole_run(method, demonstrations, tmp_path) -> None:
    learn_reward(tmp_path, method, "velocity", demonstrations, 100, irl_settings(), about={"experiment": "multi_task"})
    reward = load_learned_reward(tmp_path)
    assert (reward.method, reward.members) == (method, MEMBERS)
    assert reward.about == {"seed": 100, "experiment": "multi_task"}
    curve = pd.read_csv(tmp_path / "curve.csv")
    episodes = curve[curve["metric"] == "velocity"]
    assert episodes["step"].tolist() == [60, 60, 120, 120, 180, 180]
    assert {"success", "action_norm", "task_reward", "temperature", "curriculum"} <= set(curve["metric"])
    evaluation = pd.read_csv(tmp_path / "evaluation.csv")
    assert set(zip(evaluation["task"], evaluation["target"], strict=True)) == set(MEMBERS)
    gate = json.loads((tmp_path / "gate.json").read_text())
    assert gate["passed"] == all(member["passed"] for member in gate["members"])
    samples = pd.read_parquet(tmp_path / "samples.parquet")
    assert samples.groupby("task").size().tolist() == [180, 180]
    for task, target in MEMBERS:
        assert (tmp_path / "policies" / f"{task}-t{target}.safetensors").is_file()
    assert tuple(curve.columns) == CURVE_COLUMNS
    diagnostics = pd.read_csv(tmp_path / "diagnostics.csv", keep_default_na=False)
    assert tuple(diagnostics.columns) == DIAGNOSTIC_COLUMNS
    assert set(diagnostics["discriminator"]) == {"", "f"} | ({"task"} if method == "mt_csirl_lt" else set())


@pytest.mark.parametrize("method", METHODS)
def test_the_reward_in_the_file_is_the_one_in_memory(method, demonstrations, tmp_path) -> None:
    trainer = _run(_trainer(method, demonstrations))
    learn_reward(tmp_path, method, "velocity", demonstrations, 100, irl_settings())
    reward, sample = load_learned_reward(tmp_path), trainer.replay.sample(50)
    f = trainer.method.discriminators["f"].network
    assert torch.equal(reward(sample), f(sample) - reward.offset)
    assert reward.offset == pytest.approx(f(trainer.replay.latest(180)).mean().item(), abs=1e-5)
    if method == "mt_csirl_lt":
        own = Transitions(*(part[1] for part in sample))
        task = trainer.method.discriminators["task"].network
        expected = (task(sample) - task(trainer.replay.latest(180)).mean(dim=1, keepdim=True))[1]
        torch.testing.assert_close(reward.task_reward("drawer-close", 2)(own), expected)


def test_generators_are_paid_by_the_reward_of_this_moment(demonstrations) -> None:
    trainer = _run(_trainer("mt_csirl", demonstrations, curriculum_maximum="task"), 2)
    sample = trainer.replay.sample(64)
    f = trainer.method.discriminators["f"].network
    alpha = trainer.alpha.curriculum.weight()
    latest = trainer.replay.latest(120).task_reward  # 120 steps, fewer than the window: all count
    torch.testing.assert_close(alpha, latest.mean(dim=1) / 10)
    centre = f(trainer.replay.latest(120)).mean(dim=1)
    expected = sample.task_reward + alpha[:, None] * (f(sample) - centre[:, None])
    torch.testing.assert_close(trainer.policy_reward(sample), expected)
    rowwise = [[f(Transitions(*(part[t, i] for part in sample))).item() for i in range(64)] for t in range(2)]
    torch.testing.assert_close(f(sample), torch.tensor(rowwise))
    with torch.no_grad():
        f.parameters.add_(0.1)  # relabelled when sampled: a changed f counts at once
    assert not torch.allclose(trainer.policy_reward(sample), expected)


def test_warm_up_pays_the_task_reward_alone_and_only_to_methods_that_know_it(demonstrations) -> None:
    known, unknown = (_trainer(method, demonstrations) for method in ("mt_csirl", "mt_csirl_lt"))
    for trainer, moves in ((known, False), (unknown, True)):
        before = trainer.method.discriminators["f"].network.parameters.detach().clone()
        trainer.iterate()
        assert torch.equal(before, trainer.method.discriminators["f"].network.parameters) is not moves
    again = _trainer("mt_csirl", demonstrations)
    again.replay, sample = known.replay, known.replay.sample(8)
    assert torch.equal(again.policy_reward(sample), sample.task_reward)


def test_sac_works_with_a_scaled_reward_and_temperature(demonstrations) -> None:
    """Both by the same factor, so that the critics of two scales differ by it and the policies do not."""
    small, large = (
        _trainer("mt_csirl", demonstrations, reward_scale=scale, warm_up_iterations=0) for scale in (0.25, 1.0)
    )
    assert small.sac.temperature.tolist() == [0.25, 0.25]
    assert small.temperature.tolist() == large.temperature.tolist() == [1.0, 1.0]
    paid = []
    for trainer in (small, large):
        update = trainer.sac.update
        trainer.sac.update = lambda s, a, reward, n, update=update: (paid.append(reward), update(s, a, reward, n))
        trainer.iterate()
    torch.testing.assert_close(4 * paid[0], paid[len(paid) // 2], msg="the first minibatches are the same")


def test_scales_and_the_curriculum_switch_enter_the_policy_reward(demonstrations) -> None:
    changes = {"curriculum": False, "cs_weight": 0.5, "task_reward_scale": 0.1, "centre": False}
    trainer = _run(_trainer("mt_csirl", demonstrations, **changes), 2)
    sample = trainer.replay.sample(16)
    f = trainer.method.discriminators["f"].network(sample)
    torch.testing.assert_close(trainer.policy_reward(sample), 0.1 * sample.task_reward + 0.5 * f)


@pytest.mark.parametrize("method", ["mt_airl", "mt_vairl", "mt_vairl_gp", "mt_csirl_lt"])
def test_methods_without_the_task_reward_never_see_it(method, demonstrations) -> None:
    trainer = _run(_trainer(method, demonstrations), 2)
    sample = trainer.replay.sample(16)
    other = sample._replace(task_reward=sample.task_reward + 5.0)
    assert torch.equal(trainer.policy_reward(sample), trainer.policy_reward(other))
    assert trainer.alpha().tolist() == [1.0, 1.0]
    (batch,) = trainer._batches(1, 16)
    changed = batch._replace(generator=batch.generator._replace(task_reward=batch.generator.task_reward + 5.0))
    for discriminator in trainer.method.discriminators.values():
        assert torch.equal(discriminator.logits(batch)[1], discriminator.logits(changed)[1])


def test_the_curriculum_is_full_where_a_generator_earns_what_its_experts_do(demonstrations) -> None:
    trainer = _run(_trainer("mt_csirl", demonstrations), 2)
    experts = [pd.read_parquet(file)["task_reward"].mean() for file in demonstrations]
    expected = trainer.replay.latest(120).task_reward.mean(dim=1) / torch.tensor(experts, dtype=torch.float32)
    torch.testing.assert_close(trainer.alpha(), expected.clamp(max=1.0))
    trainer.alpha.add(torch.tensor([256 * experts[0], 0.0]))
    assert trainer.alpha()[0] == 1.0


def test_unknown_task_rewards_get_the_curriculum_only_if_asked_for(demonstrations) -> None:
    asked = {"unknown_task_curriculum": True, "curriculum_maximum": "task"}
    trainer = _run(_trainer("mt_csirl_lt", demonstrations, **asked), 1)
    torch.testing.assert_close(trainer.alpha(), trainer.replay.latest(60).task_reward.mean(dim=1) / 10)


def test_centred_rewards_average_zero_for_each_generator(demonstrations) -> None:
    trainer = _run(_trainer("mt_airl", demonstrations), 2)
    latest = trainer.replay.latest(120)
    torch.testing.assert_close(trainer.policy_reward(latest).mean(dim=1), torch.zeros(2), atol=1e-4, rtol=0)
    raw = _run(_trainer("mt_airl", demonstrations, centre=False), 2)
    assert raw.policy_reward(latest).mean(dim=1).abs().min() > 0.01


def _same(first: IrlTrainer, second: IrlTrainer) -> bool:
    ours, theirs = state(first), state(second)
    return ours.keys() == theirs.keys() and all(torch.equal(ours[name], theirs[name]) for name in ours)


def test_warm_up_has_the_temperature_of_plain_sac_and_irl_its_own(demonstrations) -> None:
    trainer = _trainer("mt_csirl", demonstrations, warm_up_iterations=2, iterations=2, reward_scale=0.25)
    temperatures = []
    for _ in range(4):
        trainer.iterate()
        temperatures.append(trainer.temperature.tolist())
    assert all(value < 0.1 for value in temperatures[0])
    assert temperatures[1:] == [[1.0, 1.0]] * 3
    as_in_irl = _trainer("mt_csirl", demonstrations, warm_up_temperature="as_in_irl", reward_scale=0.25)
    assert as_in_irl.temperature.tolist() == [1.0, 1.0]
    unknowing = _trainer("mt_airl", demonstrations, reward_scale=0.25)
    assert unknowing.temperature.tolist() == [1.0, 1.0], "it knows no task reward"


@pytest.mark.parametrize("stop", [1, 2, 3])
def test_state_restores_before_at_and_after_the_end_of_the_warm_up(demonstrations, stop) -> None:
    def trainer() -> IrlTrainer:
        return _trainer("mt_csirl", demonstrations, warm_up_iterations=2, iterations=2)

    whole, stopped, resumed = _run(trainer()), _run(trainer(), stop), trainer()
    load_state(resumed, {name: tensor.clone() for name, tensor in state(stopped).items()})
    assert _same(_run(resumed, 4 - stop), whole)


def test_one_task_printed_order_and_batched_program_are_the_same(demonstrations) -> None:
    one = demonstrations[:1]
    first, second = (_run(_trainer("mt_csirl", one, schedule=s)) for s in ("as_printed", "batched"))
    assert _same(first, second)
    assert not _same(first, _run(_trainer("mt_csirl", one, cs_weight=0.5)))


def test_per_task_rewards_do_not_depend_on_the_schedule(demonstrations) -> None:
    first, second = (
        _run(_trainer("mt_csirl_lt", demonstrations, schedule=s, warm_up_iterations=0, iterations=1))
        for s in ("as_printed", "batched")
    )
    ours, theirs = (one.method.discriminators["task"].network.parameters for one in (first, second))
    assert torch.equal(ours, theirs)
    ours, theirs = (one.method.discriminators["f"].network.parameters for one in (first, second))
    assert not torch.equal(ours, theirs)  # a shared f took T times the steps


def test_as_printed_pays_each_generator_by_f_after_its_own_turn(demonstrations) -> None:
    trainer = _run(_trainer("mt_csirl", demonstrations, schedule="as_printed"))
    sample = trainer.replay.sample(16)
    paying, final = trainer._paying["f"](sample), trainer.method.discriminators["f"].network(sample)
    torch.testing.assert_close(paying[1], final[1])  # the last task's turn leaves the final f
    assert not torch.allclose(paying[0], final[0])


def test_log_pi_is_clamped_and_as_printed_of_the_current_policy(demonstrations) -> None:
    trainer = _run(_trainer("mt_csirl", demonstrations, logit_density="as_printed"), 2)
    trainer._tabulate(random=False)
    (batch,) = trainer._batches(1, 64)
    for side, log_pi in ((batch.generator, batch.generator_log_pi), (batch.expert, batch.expert_log_pi)):
        expected = trainer.sac.log_prob(side.observation, side.action).clamp(-10, 10)
        torch.testing.assert_close(log_pi, expected, rtol=1e-4, atol=1e-4)


def test_log_pi_of_replayed_samples_is_that_of_the_mixture_that_made_them(demonstrations) -> None:
    trainer = _trainer("mt_csirl", demonstrations, generator_replay=2, iterations=4)
    policies = []
    for _ in range(4):
        policies.append(copy.deepcopy(trainer.sac))
        trainer.iterate()
    (batch,) = trainer._batches(1, 64)
    for side, log_pi in ((batch.generator, batch.generator_log_pi), (batch.expert, batch.expert_log_pi)):
        both = [sac.log_prob(side.observation, side.action).exp() for sac in policies[-2:]]
        expected = (sum(both) / 2).log().clamp(-10, 10)
        torch.testing.assert_close(log_pi, expected, rtol=1e-3, atol=1e-3)
    only_latest = policies[-1].log_prob(batch.generator.observation, batch.generator.action).clamp(-10, 10)
    assert not torch.allclose(batch.generator_log_pi, only_latest, atol=1e-2)


def test_both_densities_agree_on_the_latest_rollout_alone(demonstrations) -> None:
    first, second = (
        _run(_trainer("mt_csirl", demonstrations, generator_replay=1, logit_density=density))
        for density in ("as_printed", "mixture")
    )
    assert _same(first, second)


def test_generator_side_comes_from_the_last_iterations_only(demonstrations) -> None:
    trainer = _run(_trainer("mt_csirl", demonstrations, generator_replay=1), 2)
    latest = {tuple(row) for row in trainer.replay.latest(60).observation[0].tolist()}
    sampled = {tuple(row) for row in trainer._batches(1, 200)[0].generator.observation[0].tolist()}
    assert sampled <= latest


def test_temperature_in_the_logit_is_a_choice(demonstrations) -> None:
    for choice, expected in (("generator", 0.25), ("as_printed", 1.0)):
        trainer = _run(_trainer("mt_csirl", demonstrations, logit_temperature=choice, temperature=0.25), 1)
        assert trainer._batches(1, 4)[0].temperature.tolist() == [[pytest.approx(expected)]] * 2


def test_same_seed_same_bytes_and_resume_ends_with_them(demonstrations, tmp_path, monkeypatch) -> None:
    settings = irl_settings(warm_up_iterations=1, iterations=4)
    whole, stopped = tmp_path / "whole", tmp_path / "stopped"
    learn_reward(whole, "mt_vairl_gp", "velocity", demonstrations, 100, settings)

    iterate, count = IrlTrainer.iterate, [0]

    def killed_after_three(self) -> None:
        if count[0] == 3:
            raise KeyboardInterrupt
        count[0] += 1
        iterate(self)

    monkeypatch.setattr(IrlTrainer, "iterate", killed_after_three)
    with pytest.raises(KeyboardInterrupt):
        learn_reward(stopped, "mt_vairl_gp", "velocity", demonstrations, 100, settings)
    assert (stopped / CHECKPOINT).is_file()
    count[0] = 1  # two more iterations are left and no more than two may be made
    learn_reward(stopped, "mt_vairl_gp", "velocity", demonstrations, 100, settings)
    for name in FILES:
        assert checksum(whole / name) == checksum(stopped / name), name


def test_a_checkpoint_of_other_settings_or_a_broken_one_is_not_taken_up(demonstrations, tmp_path) -> None:
    whole = tmp_path / "whole"
    learn_reward(whole, "mt_csirl", "velocity", demonstrations, 100, irl_settings())
    other = _run(_trainer("mt_csirl", demonstrations), 1)
    for name, write in {
        "other": lambda path: save_checkpoint(path, state(other), {"curve": other.curve}, run="another run"),
        "broken": lambda path: path.write_bytes(b"half a file"),
    }.items():
        folder = tmp_path / name
        folder.mkdir()
        write(folder / CHECKPOINT)
        learn_reward(folder, "mt_csirl", "velocity", demonstrations, 100, irl_settings())
        assert all(checksum(whole / file) == checksum(folder / file) for file in FILES)


def test_the_reference_learner_trains_too(demonstrations) -> None:
    settings = irl_settings()
    one_rate = {"temperature_learning_rate": settings.sac.policy_learning_rate}
    reference = settings.sac.model_copy(update={"learner": "stable_baselines3", **one_rate})
    settings = settings.model_copy(update={"sac": reference})
    trainer = _run(make_trainer("mt_csirl", "velocity", demonstrations, 100, settings))
    assert trainer.method.discriminators["f"].network.parameters.isfinite().all()
    assert all(row["value"] == row["value"] for row in trainer.curve)


def test_unknown_names_are_one_clear_line(demonstrations, tmp_path) -> None:
    with pytest.raises(UserError, match="method: unknown 'gail'"):
        learn_reward(tmp_path, "gail", "velocity", demonstrations, 100, irl_settings())
    with pytest.raises(UserError, match="cs_reward: unknown 'grace'"):
        learn_reward(tmp_path, "mt_csirl", "grace", demonstrations, 100, irl_settings())


def test_two_rewards_of_one_task_do_not_start_equal() -> None:
    method = make_method("mt_csirl_lt", Setup(irl=irl_settings().irl, tasks=1, seed=100))
    task, f = (method.discriminators[name].network.parameters for name in ("task", "f"))
    assert not torch.allclose(task, f)


class _Counting:
    """Two environments whose observation is the number of steps since the reset."""

    def reset(self) -> np.ndarray:
        self.now = 0.0
        return np.zeros((2, 1), dtype=np.float32)

    def step(self, action: np.ndarray) -> Outcome:
        self.now += 1.0
        flags = np.array([self.now == 2.0, False])
        return Outcome(np.full((2, 1), self.now, dtype=np.float32), action[:, 0], flags, ~flags)

    def close(self) -> None: ...


def test_rollouts_reset_every_episode_and_hand_on_every_step() -> None:
    seen = []
    success, diverged = collect(_Counting(), lambda o: 10.0 + o, 5, 3, lambda *step: seen.append(step))
    assert (diverged != success).all()
    assert success.tolist() == [[False, True, False, False, True], [False] * 5]
    assert [float(observation[0, 0]) for observation, _, _ in seen] == [0, 1, 2, 0, 1]
    assert [float(action[1, 0]) for _, action, _ in seen] == [10, 11, 12, 10, 11]
    assert [float(outcome.next_observation[0, 0]) for _, _, outcome in seen] == [1, 2, 3, 1, 2]


def test_scripted_rollouts_belong_to_the_warm_up_and_to_no_discriminator(demonstrations):
    def made(scripted: int, method: str = "mt_csirl") -> IrlTrainer:
        settings = irl_settings(warm_up_iterations=3, generator_replay=3, logit_density="mixture")
        scripted_steps = dict.fromkeys(("coffee-button", "drawer-close", "reach"), scripted)
        return make_trainer(
            method, "velocity", demonstrations, 100, settings.model_copy(update={"scripted_steps": scripted_steps})
        )

    trainer = made(scripted=70)
    for _ in range(4):
        trainer.iterate()
    steps = trainer.irl.steps_per_iteration
    assert trainer.densities.generator().shape[1] == 2 * steps, "two of four rollouts were scripted"
    assert made(scripted=10_000)._scripted.steps.max() == 3 * steps, "no longer than the warm-up"
    assert made(scripted=70, method="mt_airl")._scripted.steps.max() == 0, "it does not know the task"
