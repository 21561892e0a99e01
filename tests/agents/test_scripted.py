"""Hand-written policies as explorers, in the training loop and in IRL's warm-up."""

import numpy as np
import pytest

from mtcsirl.agents.jobs import AgentJob
from mtcsirl.agents.scripted import ScriptedExplorers
from mtcsirl.agents.training import Training
from mtcsirl.settings.loading import load
from mtcsirl.settings.runs import baseline_run, irl_run
from mtcsirl.worlds.environments import make_environment


def explorers(*steps, noise=0.3, observation="mapped"):
    tasks = ["push-back"] * len(steps)
    return ScriptedExplorers(tasks, range(len(steps)), steps, [noise] * len(steps), observation)


@pytest.mark.parametrize("observation", ["raw", "mapped"])
def test_scripted_policy_solves_what_random_actions_never_meet(observation):
    scripted = explorers(120, observation=observation)
    environment = make_environment("push-back", 0, observation=observation)
    seen, _ = environment.reset()
    best = 0.0
    for step in range(120):
        action = np.zeros((1, 4), dtype=np.float32)
        scripted.replace(action, seen[None], step)
        assert np.abs(action).max() <= 1.0
        seen, reward, _, _, info = environment.step(action[0])
        best = max(best, reward)
    assert best > 5.0
    assert info["success"] or best == 10.0


def test_each_agent_has_its_own_steps_and_noise():
    scripted = explorers(3, 0, 5)
    seen = np.stack([make_environment("push-back", 0, observation="mapped").reset()[0]] * 3)
    for step in range(6):
        action = np.full((3, 4), 7.0, dtype=np.float32)
        scripted.replace(action, seen, step)
        assert [bool((row != 7.0).all()) for row in action] == [step < 3, False, step < 5]
        if step < 3:
            assert not np.array_equal(action[0], action[2])
    alone, again = np.zeros((1, 4), dtype=np.float32), np.zeros((3, 4), dtype=np.float32)
    explorers(3).replace(alone, seen[:1], 2)
    scripted.replace(again, seen, 2)
    np.testing.assert_array_equal(alone[0], again[0])


def test_success_of_the_script_does_not_end_a_warm_up(small_run):
    settings = small_run.model_copy(
        update={"warm_up_success": 0.5, "warm_up_episodes": 1, "warm_up_steps": 300, "scripted_steps": 100}
    )
    training = Training([AgentJob("push-back", 0, 100, settings)], log=lambda line: None)
    for step, counts in ((100, False), (150, True)):
        training.step = step
        training._end_warm_up(np.array([True]))
        assert training.reward.counts.tolist() == [counts]
    training.close()


def test_runs_know_the_steps_of_their_own_tasks_alone():
    settings = load()
    assert baseline_run(settings, "push-back").scripted_steps == 10_000
    assert baseline_run(settings, "reach").scripted_steps == 0
    assert irl_run(settings, "multi_target", ["push-back"]).scripted_steps == {"push-back": 10_000}
    assert irl_run(settings, "multi_task", ["reach"]).scripted_steps == {}
    assert baseline_run(load(scale="paper"), "push-back").scripted_steps == 0
