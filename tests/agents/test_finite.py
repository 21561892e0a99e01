"""Nothing is ever made of a number that is not finite, and the run says so in one line."""

import dataclasses

import numpy as np
import pytest
import torch

from mtcsirl.agents.finite import NotFiniteError, broken_agents, broken_rows
from mtcsirl.agents.jobs import AgentJob
from mtcsirl.agents.training import Training, train_agents
from mtcsirl.rewards.adapter import ground_truth
from tests.agents.bytes import run
from tests.agents.test_lockstep import learned


def test_broken_rows_and_agents_are_named() -> None:
    rows = np.zeros((4, 3))
    assert broken_rows(rows) == []
    rows[1, 2], rows[3, 0] = np.nan, -np.inf
    assert broken_rows(rows) == [1, 3]
    assert broken_rows(rows[:, 0]) == [3]
    huge = torch.full((2, 4), 3e38)
    assert broken_agents({"weights": huge}) == {}, "their sum overflows, they do not"
    huge[1, 3] = torch.nan
    assert broken_agents({"losses": torch.zeros(2, 1), "weights": huge}) == {1: "weights"}


def made(small_run, kind: str, **sac) -> AgentJob:
    same = {"progress": small_run.progress.model_copy(update={"select_every": 50, "checkpoint_every": 50})}
    settings = small_run.model_copy(update={"sac": small_run.sac.model_copy(update=sac), **same})
    expert = AgentJob("drawer-close", 1, 0, settings, "velocity", ground_truth("velocity", "mapped"), gate="expert")
    if kind == "transfer":
        return dataclasses.replace(expert, f=learned(), gate="sac", keep="last", reward_id="f")
    return expert if kind == "expert" else dataclasses.replace(expert, f=None, cs_reward="", gate="sac")


KINDS = ("expert", "sac", "transfer")


@pytest.mark.parametrize("learner", ["fused", "stable_baselines3"])
@pytest.mark.parametrize("kind", KINDS)
def test_a_learning_rate_that_explodes_ends_the_run_and_leaves_the_checkpoint_from_before(
    small_run, tmp_path, kind, learner
) -> None:
    rates = dict.fromkeys(("policy_learning_rate", "critic_learning_rate", "temperature_learning_rate"), 1e10)
    job = made(small_run, kind, learner=learner, **rates)
    file = tmp_path / "checkpoint"
    lines: list[str] = []
    with pytest.raises(NotFiniteError) as caught:
        train_agents([job], checkpoints=[file], log=lines.append)
    line = str(caught.value)
    assert "\n" not in line
    assert all(
        part in line
        for part in ("drawer-close-t1 s0: ", "became non-finite at step", "sac.critic_learning_rate 1e+10", str(file))
    )
    training = Training([job], checkpoints=[file], log=lambda line: None)
    from mtcsirl.agents import resume

    resume.restore(training, [resume.load(job, file)], lines.append)
    assert training.step >= 100, "the last checkpoint is of a step with numbers"
    assert training.learner.broken_agents() == {}
    assert all(np.isfinite(value) for _, _, value in training.curves[0])
    training.close()


@pytest.mark.parametrize("kind", KINDS)
def test_a_learning_rate_of_the_actor_or_the_temperature_alone_too(small_run, kind) -> None:
    for rate in ("policy_learning_rate", "critic_learning_rate"):
        job = made(small_run, kind, updates_per_step=1.0, **{rate: 1e30})
        with pytest.raises(NotFiniteError, match=r"non-finite at step \d+ with sac.policy_learning_rate"):
            train_agents([job], log=lambda line: None)


def test_a_reward_that_is_no_number_ends_the_run(small_run) -> None:
    def broken(transitions):
        return transitions.task_reward + torch.where(transitions.action[..., 0] > 0.9, torch.nan, 0.0)

    job = dataclasses.replace(made(small_run, "transfer"), f=broken)
    with pytest.raises(NotFiniteError, match="non-finite at step"):
        train_agents([job], log=lambda line: None)


@pytest.mark.parametrize("part", ["task_reward", "next_observation"])
def test_what_the_environment_says_has_to_be_finite(small_run, part) -> None:
    training = Training([made(small_run, "sac")] * 2, log=lambda line: None)
    step = training.environments.step

    def broken(action):
        outcome = step(action)
        if training.step == 7:
            getattr(outcome, part)[1] = np.inf
        return outcome

    training.environments.step = broken
    with pytest.raises(NotFiniteError, match=r"the (task reward|observation) became non-finite at step 7") as caught:
        training.run()
    assert caught.value.agents == (1,)
    training.close()


def test_others_of_a_batch_go_on_from_their_checkpoints(small_run, tmp_path) -> None:
    good, bad = made(small_run, "expert"), made(small_run, "sac", reward_scale=1e38)
    alone = run([good], tmp_path / "alone")
    files = [tmp_path / "bad", tmp_path / "good"]
    with pytest.raises(NotFiniteError) as caught:
        train_agents([bad, good], checkpoints=files, log=lambda line: None)
    assert caught.value.agents == (0,)
    lines: list[str] = []
    assert run([good], tmp_path / "after", checkpoints=files[1:], log=lines.append) == alone
    assert lines[0].startswith("resumed at step")
