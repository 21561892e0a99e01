"""The training loop on Meta-World's reach: same bytes twice, same bytes after a kill, lockstep, the reference."""

import dataclasses

import numpy as np
import pandas as pd
import pytest

from mtcsirl.agents import resume
from mtcsirl.agents import selection as selection_module
from mtcsirl.agents.jobs import AgentJob, gate_score
from mtcsirl.agents.training import Training, train_agents
from mtcsirl.episodes.evaluation import evaluate
from mtcsirl.errors import UserError
from mtcsirl.names import KEPT, LAST
from mtcsirl.rewards.adapter import ground_truth
from tests.agents.bytes import killed_at, run


def expert(settings, seed=0, task="reach"):
    f = ground_truth("velocity", settings.environment.observation)
    return AgentJob(task, 1, seed, settings, "velocity", f, gate="expert")


def with_sac(settings, **changes):
    return settings.model_copy(update={"sac": settings.sac.model_copy(update=changes)})


def with_learner(settings, learner):
    """stable-baselines3 has one learning rate."""
    same = {"temperature_learning_rate": settings.sac.policy_learning_rate}
    return with_sac(settings, learner=learner, **(same if learner == "stable_baselines3" else {}))


@pytest.mark.parametrize("learner", ["fused", "stable_baselines3"])
def test_training_twice_gives_the_same_bytes(small_run, tmp_path, learner):
    settings = with_learner(small_run, learner)
    first = run([expert(settings)], tmp_path / "first")
    assert first == run([expert(settings)], tmp_path / "second")
    assert first != run([expert(settings, seed=1)], tmp_path / "other")


@pytest.mark.parametrize("learner", ["fused", "stable_baselines3"])
@pytest.mark.parametrize("agents", [1, 2])
def test_killed_run_resumes_to_the_same_bytes(small_run, tmp_path, learner, agents):
    settings = with_learner(small_run, learner)
    jobs = [expert(settings, seed) for seed in range(agents)]
    uninterrupted = run(jobs, tmp_path / "uninterrupted")
    checkpoints = [tmp_path / f"checkpoint_{agent}" for agent in range(agents)]
    killed_at(225, jobs, checkpoints)
    assert all(file.is_file() for file in checkpoints)
    lines = []
    assert run(jobs, tmp_path / "resumed", checkpoints=checkpoints, log=lines.append) == uninterrupted
    assert lines[0] == "resumed at step 200"


def test_checkpoint_of_other_settings_or_code_is_not_resumed(small_run, tmp_path, caplog):
    checkpoint = tmp_path / "checkpoint"
    first = Training(
        [dataclasses.replace(expert(small_run), made_from="code 1")], checkpoints=[checkpoint], log=lambda line: None
    )
    first.run()
    first.close()
    for job, code in ((expert(small_run, seed=3), "code 1"), (expert(small_run), "code 2")):
        caplog.clear()
        lines = []
        train_agents([dataclasses.replace(job, made_from=code)], checkpoints=[checkpoint], log=lines.append)
        assert "other settings, inputs or code; starting from the beginning" in caplog.text
        assert not any("resumed" in line for line in lines)
        first = Training(
            [dataclasses.replace(expert(small_run), made_from="code 1")],
            checkpoints=[checkpoint],
            log=lambda line: None,
        )
        first.run()
        first.close()
    lines = []
    train_agents(
        [dataclasses.replace(expert(small_run), made_from="code 1")], checkpoints=[checkpoint], log=lines.append
    )
    assert any("resumed" in line for line in lines)


def test_a_damaged_checkpoint_is_one_line_and_a_new_start(small_run, tmp_path, caplog):
    (tmp_path / "checkpoint").write_bytes(b"half")
    fresh = run([expert(small_run)], tmp_path / "fresh")
    assert run([expert(small_run)], tmp_path / "run", checkpoints=[tmp_path / "checkpoint"]) == fresh
    assert "checkpoint: damaged" in caplog.text


def test_agents_in_lockstep_may_differ_in_reward_alone(small_run, tmp_path):
    plain = AgentJob("reach", 1, 0, with_sac(small_run, reward_scale=0.1))
    agents = train_agents([expert(small_run), plain], log=lambda line: None)
    assert [agent.gate["gate"] for agent in agents] == ["expert", "sac"]
    wider = with_sac(small_run, minibatch=64)
    with pytest.raises(UserError, match="reach-t1 s0: agents in lockstep"):
        train_agents([expert(small_run), expert(wider)])


def test_rows(small_run):
    lines = []
    (agent,) = train_agents([expert(small_run)], log=lines.append)
    curve = agent.curve
    assert list(curve.columns) == ["step", "metric", "value"]
    episodes = curve[curve.metric == "success"]
    assert episodes.step.tolist() == [50, 100, 150, 200, 250, 300]
    assert {"velocity", "action_norm", "task_reward", "temperature", "critic_loss"} <= set(curve.metric)
    evaluation = pd.DataFrame(agent.evaluation)
    assert list(evaluation.columns) == [
        "task",
        "target",
        "cs_reward",
        "seed",
        "policy",
        "kept",
        "episode",
        "metric",
        "value",
    ]
    assert (evaluation["kept"] == "kept").sum() == 2 * 2 * 7
    assert lines[-1].startswith("step 300/300")
    assert all(word in lines[-1] for word in ("steps/s", "left", "success", "|a|_1", "velocity", "temperature"))


def test_every_update_is_made_and_none_before_the_random_steps_end(small_run):
    training = Training([expert(small_run)], log=lambda line: None)
    counts = []
    original = training._update

    def update():
        original()
        counts.append((training.step, training.learner.updates))

    training._update = update
    training.run()
    training.close()
    made = dict(counts)
    assert made[100] == 0
    assert made[105] == 1
    assert made[300] == 40


def test_cs_reward_counts_for_good_once_recent_episodes_succeed(small_run):
    waiting = small_run.model_copy(update={"warm_up_success": 0.5, "warm_up_episodes": 2, "warm_up_steps": 200})
    training = Training([expert(waiting), expert(waiting, seed=1)], log=lambda line: None)
    counts = []
    for solved in ([True, False], [False, False], [False, False], [False, True]):
        training._end_warm_up(np.array(solved))
        counts.append(training.reward.counts.tolist())
    assert counts == [[False, False], [True, False], [True, False], [True, True]]
    training.reward.counts[:] = False
    training.step = 200
    training._end_warm_up(np.array([False, False]))
    assert training.reward.counts.tolist() == [True, True], "at the latest"
    training.close()
    at_once = Training([expert(small_run)], log=lambda line: None)
    assert at_once.reward.counts.tolist() == [True]
    at_once.close()


def test_killed_run_remembers_whose_warm_up_is_over(small_run, tmp_path):
    waiting = small_run.model_copy(update={"warm_up_success": 0.5, "warm_up_episodes": 2, "warm_up_steps": 200})
    jobs = [expert(waiting), expert(waiting, seed=1)]
    files = [tmp_path / "first", tmp_path / "second"]
    killed = Training(jobs, checkpoints=files, log=lambda line: None)
    for solved in ([True, False], [True, False], [False, True]):
        killed._end_warm_up(np.array(solved))
    killed.step = 100
    resume.save(killed)
    resumed = Training(jobs, checkpoints=files, log=lambda line: None)
    saved = [resume.load(job, file) for job, file in zip(jobs, files, strict=True)]
    resume.restore(resumed, saved, lambda line: None)
    assert resumed.reward.counts.tolist() == killed.reward.counts.tolist() == [True, True]
    assert resumed.recent == [[True, False], [False, True]]
    for training in (killed, resumed):
        training.close()


def test_best_policy_of_the_trials_is_kept(small_run, monkeypatch):
    scores = iter([(0.0, -0.5, 9.0), (1.0, -0.4, 5.0), (1.0, -0.9, 9.0)])
    monkeypatch.setattr(selection_module, "gate_score", lambda job, means: next(scores))
    training = Training([expert(small_run)], log=lambda line: None)
    seen = []
    original = training._try_policies

    def try_policies():
        original()
        seen.append(training.learner.policy(0))

    training._try_policies = try_policies
    training.run()
    (kept,) = training.finish()
    training.close()
    assert np.array_equal(kept.policy.weights[0], seen[1].weights[0])
    (last,) = train_agents([dataclasses.replace(expert(small_run), keep="last")], log=lambda line: None)
    assert np.array_equal(last.policy.weights[0], seen[2].weights[0])


def test_gate_score_puts_success_first(small_run):
    job = expert(small_run)
    solved = {"success": 1.0, "velocity": 0.2, "task_reward": 1.0}
    fast = {"success": 0.5, "velocity": 0.8, "task_reward": 9.0}
    assert gate_score(job, solved) > gate_score(job, fast)
    assert gate_score(job, solved | {"velocity": 0.7}) > gate_score(job, solved)
    near, nearest = {"velocity": 0.75, "task_reward": 5.0}, {"velocity": 0.8, "task_reward": 4.0}
    assert gate_score(job, solved | near) > gate_score(job, solved | nearest), "both well inside the gate"
    plain = AgentJob("reach", 1, 0, small_run)
    assert gate_score(plain, solved | {"task_reward": 2.0}) > gate_score(plain, solved)


def test_events_are_written_on_request(small_run, tmp_path):
    pytest.importorskip("tensorboard", reason="pip install 'mtcsirl[tensorboard]'")
    train_agents([expert(small_run)], log=lambda line: None, events=tmp_path / "events")
    assert list((tmp_path / "events").glob("events.out.tfevents*"))


def test_a_policy_that_is_kept_and_last_is_evaluated_once(small_run, monkeypatch):
    """Its rows are those of an evaluation of its own all the same; a policy kept from before has others."""
    for score, twice in ((1.0, False), (-1.0, True)):
        scores = iter([(0.0, 0.0, score * step) for step in (100, 200, 300)])
        monkeypatch.setattr(selection_module, "gate_score", lambda job, means, scores=scores: next(scores))
        training = Training([expert(small_run)], log=lambda line: None)
        training.run()
        calls = []
        each = training.environments.each

        def counted(function, arguments, each=each, calls=calls):
            calls.append(sum(own is not None for own in arguments))
            return each(function, arguments)

        training.environments.each = counted
        (agent,) = training.finish()
        assert sum(calls) == (2 if twice else 1)
        job = training.jobs[0]
        own = evaluate(training.policy(0), job.task, job.target, job.cs_reward, job.seed, job.settings, LAST)
        assert [row for row in agent.evaluation if row[KEPT] == LAST] == own
        training.close()
