"""A batch is invisible: whatever trains beside an agent, it leaves the bytes of one trained alone."""

import dataclasses

import pytest
import torch

from mtcsirl.agents import resume
from mtcsirl.agents.jobs import AgentJob
from mtcsirl.agents.training import Training, train_agents
from mtcsirl.rewards.adapter import ground_truth
from mtcsirl.rewards.learned import LearnedReward
from mtcsirl.rewards.networks import RewardNetwork
from tests.agents.bytes import killed_at, run

ARCHITECTURE = {
    "kind": "perceptron", "observation_size": 39, "action_size": 4, "hidden_sizes": [16, 16],
    "output_scale": 10.0, "shaping": False, "discount": 0.97,
}  # fmt: skip
MEMBERS = (("reach", 1), ("drawer-close", 2))


def learned() -> LearnedReward:
    f, task = (RewardNetwork(ARCHITECTURE, count, torch.Generator().manual_seed(count)) for count in (1, 2))
    return LearnedReward(f, "mt_csirl_lt", "velocity", "mapped", MEMBERS, 0.5, task, (0.1, 0.2))


@pytest.fixture
def jobs(small_run) -> list[AgentJob]:
    """Experts of both cs-rewards, a baseline and transfer agents, with scripted and held actions among them."""

    def settings(reward_scale=1.0, **changes):
        sac = small_run.sac.model_copy(update={"reward_scale": reward_scale, "minibatch": 50})
        same = {"held_steps": 8, "held_until": 0.9, "warm_up_success": 0.5, "warm_up_episodes": 2, "warm_up_steps": 200}
        return small_run.model_copy(update={"sac": sac, "cs_weight": 0.0, "curriculum": False, **same, **changes})

    speed, norm = (ground_truth(name, "mapped") for name in ("velocity", "action_norm"))
    reward = learned()
    own = settings(cs_weight=20.0, curriculum=True, held_share=0.3)
    fast = AgentJob("reach", 1, 0, own, "velocity", speed, gate="expert")
    own = settings(0.1, cs_weight=5.0)
    strong = AgentJob("drawer-close", 2, 1, own, "action_norm", norm, gate="expert")
    plain = AgentJob("push-back", 0, 2, settings(0.1, scripted_steps=120, scripted_noise=0.3))
    own = settings(0.1, cs_weight=1.0)
    new = AgentJob("reach", 1, 0, own, "velocity", reward, keep="last", reward_id="f")
    other = dataclasses.replace(new, task="drawer-close", target=2, seed=7, task_reward=reward.task_reward(*MEMBERS[1]))
    return [fast, strong, plain, new, other]


@pytest.fixture
def alone(jobs, tmp_path) -> list[dict[str, bytes]]:
    return [run([job], tmp_path / f"alone_{index}")[0] for index, job in enumerate(jobs)]


@pytest.mark.slow
def test_any_batch_in_any_order_with_and_without_workers(jobs, alone, tmp_path) -> None:
    assert len({agent["policy.safetensors"] for agent in alone}) == len(jobs), "they tell each other apart"
    batches = [([0, 1], 0), ([3, 0, 2], 0), ([4, 3, 2, 1, 0], 0), ([1, 4, 0], 1), ([2, 1, 3], 2)]
    for number, (order, workers) in enumerate(batches):
        found = run([jobs[index] for index in order], tmp_path / f"batch_{number}", workers=workers)
        for index, agent in zip(order, found, strict=True):
            different = [name for name, content in agent.items() if content != alone[index][name]]
            assert not different, (order, workers, index)


@pytest.mark.slow
def test_a_batch_that_was_killed_goes_on_alone_and_runs_that_were_killed_go_on_in_a_batch(
    jobs, alone, tmp_path
) -> None:
    first = [tmp_path / f"first_{index}" for index in range(len(jobs))]
    killed_at(225, jobs, first)
    assert [run([jobs[i]], tmp_path / f"a{i}", checkpoints=[first[i]])[0] for i in (0, 2, 4)] == [
        alone[i] for i in (0, 2, 4)
    ]
    assert run([jobs[3], jobs[1]], tmp_path / "pair", checkpoints=[first[3], first[1]]) == [alone[3], alone[1]]

    second = [tmp_path / f"second_{index}" for index in range(3)]
    for index, step in enumerate((225, 225, 130)):  # the last checkpoints are of steps 200, 200 and 100
        killed_at(step, [jobs[index]], [second[index]])
    lines: list[str] = []
    files = [*second, tmp_path / "none"]
    assert run(jobs[:4], tmp_path / "batch", checkpoints=files, log=lines.append) == alone[:4]
    assert [line for line in lines if line.startswith("resumed")] == ["resumed at step 100", "resumed at step 200"]


def test_the_checkpoint_of_an_agent_holds_the_same_too(jobs, tmp_path) -> None:
    alone, among = tmp_path / "alone", [tmp_path / name for name in ("other", "among", "third")]
    killed_at(225, [jobs[0]], [alone])
    killed_at(225, [jobs[4], jobs[0], jobs[1]], among)
    (tensors, notes), (others, noted) = (resume.load(jobs[0], file) for file in (alone, among[1]))
    assert notes.pop("spent") != noted.pop("spent"), "all but the time that it took"
    assert notes == noted
    assert tensors.keys() == others.keys()
    assert all(torch.equal(tensor, others[name]) for name, tensor in tensors.items())


@pytest.mark.slow
def test_the_reference_learner_in_a_batch_too(jobs, tmp_path) -> None:
    def reference(job: AgentJob) -> AgentJob:
        rate = {"temperature_learning_rate": job.settings.sac.policy_learning_rate, "learner": "stable_baselines3"}
        sac = job.settings.sac.model_copy(update=rate)
        return dataclasses.replace(job, settings=job.settings.model_copy(update={"sac": sac}))

    pair = [reference(jobs[0]), reference(jobs[1])]
    alone = [run([job], tmp_path / f"alone_{index}")[0] for index, job in enumerate(pair)]
    assert run(pair[::-1], tmp_path / "batch") == alone[::-1]


def test_who_trained_together_is_noted_beside_the_numbers(jobs) -> None:
    agents = train_agents(jobs[:2], log=lambda line: None)
    assert [agent.lockstep for agent in agents] == [("reach-t1 s0", "drawer-close-t2 s1")] * 2


def _diverging(jobs, agent: int, step: int) -> Training:
    """A training whose simulation of one agent is thrown out of the finite numbers in one step."""
    training = Training(jobs, log=lambda line: None)
    simulator = training.environments.environments[agent].simulator
    original = training.environments.step

    def thrown(action):
        if training.step == step:
            simulator.data.qvel[:] = 1e30
        return original(action)

    training.environments.step = thrown
    return training


def test_an_agent_whose_simulation_diverges_starts_over_and_no_other_notices(
    jobs, alone, tmp_path, monkeypatch
) -> None:
    monkeypatch.chdir(tmp_path)  # MuJoCo writes a log where it is
    lone, batch = _diverging([jobs[0]], 0, 170), _diverging([jobs[1], jobs[0], jobs[3]], 1, 170)
    for training in (lone, batch):
        training.run()
    rows = [training.replay.latest(300) for training in (lone, batch)]
    for part, among in zip(*rows, strict=True):
        assert torch.equal(part[0], among[1])
    step = 170
    observation, action, _, _ = (part[0] for part in rows[0])
    assert torch.equal(observation[step], observation[step - 1]), "the last good transition stands in its place"
    assert torch.equal(action[step], action[step - 1])
    first = torch.from_numpy(lone.environments.reset()[0])
    assert torch.equal(observation[step + 1], first), "and its environment has started over"
    assert all(part.isfinite().all() for part in rows[0])
    marked = [(at, value) for at, name, value in lone.curves[0] if name == "diverged"]
    assert marked == [(200, 1.0)]
    assert dict((at, value) for at, name, value in lone.curves[0] if name == "success")[200] == 0.0
    agents = [training.finish() for training in (lone, batch)]
    for training in (lone, batch):
        training.close()
    for folder, agent in (("lone", agents[0][0]), ("among", agents[1][1]), ("neighbour", agents[1][0])):
        agent.save(tmp_path / folder)
    for name in alone[0]:
        assert (tmp_path / "lone" / name).read_bytes() == (tmp_path / "among" / name).read_bytes(), name
        assert (tmp_path / "neighbour" / name).read_bytes() == alone[1][name], name
    assert (tmp_path / "lone" / "policy.safetensors").read_bytes() != alone[0]["policy.safetensors"]
