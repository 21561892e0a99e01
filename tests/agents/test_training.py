"""The training loop on Meta-World's reach: same bytes twice, same bytes after a kill, lockstep, the reference."""

import dataclasses

import numpy as np
import pandas as pd
import pytest

from mtcsirl.agents import training as training_module
from mtcsirl.agents.jobs import AgentJob, gate_score
from mtcsirl.agents.training import Training, train_agents
from mtcsirl.errors import UserError
from mtcsirl.rewards.mixture import ground_truth

WRITTEN = ("curve.csv", "evaluation.csv", "gate.json", "policy.json", "policy.safetensors")


def expert(settings, seed=0, task="reach"):
    f = ground_truth("velocity", settings.environment.observation)
    return AgentJob(task, 1, seed, settings, "velocity", f, gate="expert")


def with_sac(settings, **changes):
    return settings.model_copy(update={"sac": settings.sac.model_copy(update=changes)})


def with_learner(settings, learner):
    """stable-baselines3 has one learning rate."""
    same = {"temperature_learning_rate": settings.sac.policy_learning_rate}
    return with_sac(settings, learner=learner, **(same if learner == "stable_baselines3" else {}))


def run(jobs, folder, **options):
    """Train and save; return the bytes of everything written."""
    agents = train_agents(jobs, log=lambda line: None, **options)
    for index, agent in enumerate(agents):
        agent.save(folder / str(index))
    return {
        f"{index}/{name}": (folder / str(index) / name).read_bytes() for index in range(len(agents)) for name in WRITTEN
    }


@pytest.mark.parametrize("learner", ["fused", "stable_baselines3"])
def test_training_twice_gives_the_same_bytes(small_run, tmp_path, learner):
    settings = with_learner(small_run, learner)
    first = run([expert(settings)], tmp_path / "first")
    assert first == run([expert(settings)], tmp_path / "second")
    assert first != run([expert(settings, seed=1)], tmp_path / "other")


class KilledError(Exception):
    pass


@pytest.mark.parametrize("learner", ["fused", "stable_baselines3"])
@pytest.mark.parametrize("agents", [1, 2])
def test_killed_run_resumes_to_the_same_bytes(small_run, tmp_path, learner, agents):
    settings = with_learner(small_run, learner)
    jobs = [expert(settings, seed) for seed in range(agents)]
    uninterrupted = run(jobs, tmp_path / "uninterrupted")

    checkpoint = tmp_path / "checkpoint"
    killed = Training(jobs, checkpoint=checkpoint, log=lambda line: None)
    original = killed.environments.step

    def step(action):
        if killed.step == 225:
            raise KilledError
        return original(action)

    killed.environments.step = step
    with pytest.raises(KilledError):
        killed.run()
    killed.close()
    assert checkpoint.is_file()

    lines = []
    agents_trained = train_agents(jobs, checkpoint=checkpoint, log=lines.append)
    assert lines[0] == "resumed at step 200"
    for index, agent in enumerate(agents_trained):
        agent.save(tmp_path / "resumed" / str(index))
    resumed = {key: (tmp_path / "resumed" / key).read_bytes() for key in uninterrupted}
    assert resumed == uninterrupted
    assert not checkpoint.exists()


def test_checkpoint_of_other_settings_is_not_resumed(small_run, tmp_path):
    checkpoint = tmp_path / "checkpoint"
    first = Training([expert(small_run)], checkpoint=checkpoint, log=lambda line: None)
    first.run()
    first.close()
    lines = []
    train_agents([expert(small_run, seed=3)], checkpoint=checkpoint, log=lines.append)
    assert "other settings" in lines[0]


def test_damaged_checkpoint_is_one_line(small_run, tmp_path):
    (tmp_path / "checkpoint").write_bytes(b"half")
    with pytest.raises(UserError, match="checkpoint"):
        train_agents([expert(small_run)], checkpoint=tmp_path / "checkpoint")


def test_workers_change_nothing(small_run, tmp_path):
    jobs = [expert(small_run, 0), expert(small_run, 1, "drawer-close")]
    assert run(jobs, tmp_path / "here") == run(jobs, tmp_path / "workers", workers=2)


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
        counts.append(training._reward.counts.tolist())
    assert counts == [[0.0, 0.0], [1.0, 0.0], [1.0, 0.0], [1.0, 1.0]]
    training._reward.counts.zero_()
    training.step = 200
    training._end_warm_up(np.array([False, False]))
    assert training._reward.counts.tolist() == [1.0, 1.0], "at the latest"
    training.close()
    at_once = Training([expert(small_run)], log=lambda line: None)
    assert at_once._reward.counts.tolist() == [1.0]
    at_once.close()


def test_killed_run_remembers_whose_warm_up_is_over(small_run, tmp_path):
    waiting = small_run.model_copy(update={"warm_up_success": 0.5, "warm_up_episodes": 2, "warm_up_steps": 200})
    jobs = [expert(waiting), expert(waiting, seed=1)]
    killed = Training(jobs, checkpoint=tmp_path / "checkpoint", log=lambda line: None)
    for solved in ([True, False], [True, False], [False, True]):
        killed._end_warm_up(np.array(solved))
    killed._save(tmp_path / "checkpoint")
    resumed = Training(jobs, checkpoint=tmp_path / "checkpoint", log=lambda line: None)
    resumed._resume(tmp_path / "checkpoint")
    assert resumed._reward.counts.tolist() == killed._reward.counts.tolist() == [1.0, 1.0]
    assert resumed._recent == [[True, False], [False, True]]
    for training in (killed, resumed):
        training.close()


def test_best_policy_of_the_trials_is_kept(small_run, monkeypatch):
    scores = iter([(0.0, -0.5, 9.0), (1.0, -0.4, 5.0), (1.0, -0.9, 9.0)])
    monkeypatch.setattr(training_module, "gate_score", lambda job, means: next(scores))
    training = Training([expert(small_run)], log=lambda line: None)
    seen = []
    original = training._try_policies

    def try_policies():
        original()
        seen.append(training.learner.policy(0))

    training._try_policies = try_policies
    training.run()
    training.close()
    assert np.array_equal(training._kept(0).weights[0], seen[1].weights[0])
    training.jobs[0] = dataclasses.replace(training.jobs[0], keep="last")
    assert np.array_equal(training._kept(0).weights[0], seen[2].weights[0])


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
