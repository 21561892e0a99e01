"""What is to be trained, and what a finished run leaves behind."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from mtcsirl.episodes.evaluation import COLUMNS, Row
from mtcsirl.episodes.gates import metric_limit, relative_distance
from mtcsirl.episodes.policy import Policy, save_policy
from mtcsirl.errors import UserError
from mtcsirl.files import storage
from mtcsirl.rewards.mixture import RewardMixture
from mtcsirl.settings.runs import AgentRunSettings
from mtcsirl.transitions import RewardFunction

if TYPE_CHECKING:
    import pandas as pd


@dataclass(frozen=True)
class AgentJob:
    """One agent to train: where, on what, with which seed.

    f is the cs-reward (ground truth for an expert, learned for a transfer agent; it sees transitions as the agent
    does), weighted by the settings' cs_weight and curriculum. `task_reward` replaces the environment's reward.
    `cs_reward` names the behaviour in the rows and in the gate. `keep` says which policy the run leaves: the best
    by the gate over trials during training, or the last.
    """

    task: str
    target: int
    seed: int
    settings: AgentRunSettings
    cs_reward: str = ""
    f: RewardFunction | None = None
    task_reward: RewardFunction | None = None
    gate: Literal["expert", "sac"] = "sac"
    keep: Literal["best", "last"] = "best"
    reward_id: str = ""
    """Tells learned rewards apart, for example a checksum: a run never resumes from a checkpoint of another reward."""
    made_from: str = ""
    """Hash of the run's identity: a run never resumes from a checkpoint of other code either."""
    inputs: Mapping[str, Path] = field(default_factory=dict)
    """Files that the job was made from, by name; provenance.json lists their checksums."""

    @property
    def label(self) -> str:
        """The agent in a line to the user."""
        return f"{self.task}-t{self.target} s{self.seed}"

    def mixture(self) -> RewardMixture:
        """The reward that this agent's policy is trained on."""
        settings = self.settings
        scale = settings.sac.reward_scale
        return RewardMixture(scale, settings.cs_weight, settings.curriculum, self.f, self.task_reward)

    def fingerprint(self) -> str:
        """Differs between jobs whose results may differ: the checkpoint of another job is not resumed."""
        key = (self.task, self.target, self.seed, self.cs_reward, self.gate, self.keep, self.reward_id, self.made_from)
        return hashlib.sha256(repr((key, self.settings.model_dump_json())).encode()).hexdigest()


@dataclass(frozen=True)
class TrainedAgent:
    """What a finished run leaves behind."""

    job: AgentJob
    policy: Policy
    curve: pd.DataFrame
    evaluation: list[Row]
    gate: dict[str, Any]
    lockstep: tuple[str, ...] = ()
    """Labels of all agents that trained beside it and of itself: where a number was made, no part of the number."""

    def save(self, folder: Path | str) -> None:
        """Write policy.safetensors, policy.json, curve.csv, evaluation.csv and gate.json."""
        import pandas as pd

        folder = Path(folder)
        save_policy(self.policy, folder)
        storage.write_csv(folder / "curve.csv", self.curve)
        storage.write_csv(folder / "evaluation.csv", pd.DataFrame(self.evaluation, columns=list(COLUMNS)))
        storage.write_json(folder / "gate.json", self.gate)


def common_settings(settings: AgentRunSettings) -> AgentRunSettings:
    """``settings`` without what agents that train in lockstep may differ in: agents in one batch agree in the rest."""
    own: dict[str, Any] = {"cs_weight": 0.0, "curriculum": False}
    own |= {"scripted_steps": 0, "scripted_noise": 0.0, "held_share": 0.0}
    sac = settings.sac.model_copy(update={"reward_scale": 1.0})
    return settings.model_copy(update={**own, "sac": sac})


def shared_settings(jobs: Sequence[AgentJob]) -> AgentRunSettings:
    """The settings of agents that train in lockstep.

    Raises UserError when they differ in more than reward scale, cs_weight, curriculum, scripted steps or held share.
    """
    first = common_settings(jobs[0].settings)
    for job in jobs:
        if common_settings(job.settings) != first:
            raise UserError(
                f"{job.label}: agents in lockstep share all settings but reward_scale, "
                "cs_weight, curriculum, scripted_steps and held_share; train it on its own"
            )
    return jobs[0].settings


def gate_score(job: AgentJob, means: dict[str, float]) -> tuple[float, float, float]:
    """How good a policy looks to its gate: success first, an expert's nearness to the target, then task reward.

    Within half of the gate's limit every distance counts as none: the nearest of many trials would be one that three
    lucky episodes flatter, not the one that does its task best.
    """
    beyond = 0.0
    if job.gate == "expert":
        limit = metric_limit("expert", job.cs_reward, job.settings.gates)
        beyond = max(0.0, relative_distance(means[job.cs_reward], job.cs_reward) - limit / 2)
    return means["success"], -beyond, means["task_reward"]
