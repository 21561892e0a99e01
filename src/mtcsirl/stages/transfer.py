"""Stage ``transfer``: SAC from scratch on r_task + f with a frozen learned f.

The policy after the last step is kept: choosing one by the true metric would use what the learned reward has to convey.
"""

from pathlib import Path
from typing import NamedTuple

from mtcsirl.agents.jobs import AgentJob
from mtcsirl.files import storage
from mtcsirl.rewards.learned import DESCRIPTION, WEIGHTS, check_learned, load_learned_reward
from mtcsirl.settings.runs import AgentRunSettings
from mtcsirl.stages.agents import agent_task, train
from mtcsirl.stages.running import Input, look_at

STAGE = "transfer"


class NewAgent(NamedTuple):
    """Where a new agent learns, and whether ``known`` or ``learned`` (Table 4) task rewards stand in for r_task."""

    cs_reward: str
    task: str
    target: int
    seed: int
    task_reward: str = "known"

    def about(self) -> dict[str, object]:
        """The part of its key that its numbers depend on beside the reward."""
        return self._asdict()


def transfer_job(settings: AgentRunSettings, reward: Path, agent: NewAgent) -> AgentJob:
    """The agent on the reward in the folder ``reward``.

    Raises:
        UserError: the reward was learned from experts of another cs-reward or on another observation.
    """
    learned = load_learned_reward(reward).to(settings.sac.device)
    check_learned(learned, reward, cs_reward=agent.cs_reward, observation=settings.environment.observation)
    own = learned.task_reward(agent.task, agent.target) if agent.task_reward == "learned" else None
    return AgentJob(
        agent.task,
        agent.target,
        agent.seed,
        settings,
        agent.cs_reward,
        f=learned,
        task_reward=own,
        gate="sac",
        keep="last",
        reward_id=storage.checksum(reward / WEIGHTS),
        inputs={name: reward / name for name in (WEIGHTS, DESCRIPTION)},
    )


def reward_input(reward: Path) -> dict[str, Input]:
    """The learned reward as an input."""
    return {"reward": look_at(reward, (WEIGHTS, DESCRIPTION))}


def transfer(
    settings: AgentRunSettings, reward: Path, agent: NewAgent, output: Path, *, wanted: str | None = None
) -> None:
    """Train a new agent on the frozen reward in the folder ``reward`` into the folder ``output``."""
    job = transfer_job(settings, reward, agent)
    train(job, agent_task(STAGE, agent.about(), job, output, wanted, reward_input(reward)))
