"""Which policy a run leaves: trials of the policy during training, judged as its gate will."""

from __future__ import annotations

from collections.abc import Sequence

import gymnasium
import numpy as np

from mtcsirl.agents.jobs import AgentJob, gate_score
from mtcsirl.agents.streams import Purpose
from mtcsirl.episodes.evaluation import run_episode
from mtcsirl.episodes.policy import Policy

Score = tuple[float, float, float]


class Selection:
    """The best policy of one agent so far, by the gate."""

    def __init__(self, job: AgentJob) -> None:
        self.wanted = job.keep == "best" and job.settings.progress.select_episodes > 0
        """Whether the run leaves the best policy, not the last."""
        self.score: Score | None = None
        self.policy: Policy | None = None
        self._job = job

    def trial(self, policy: Policy, step: int) -> tuple[Policy, int, int, tuple[int, ...]]:
        """What `trial_episodes` takes to try this policy after so many steps."""
        progress, length = self._job.settings.progress, self._job.settings.evaluation.episode_steps
        return policy, progress.select_episodes, length, (self._job.seed, int(Purpose.TRIALS), step)

    def judge(self, policy: Policy, episodes: Sequence[dict[str, float]]) -> None:
        """Keep the policy if no earlier one has a better score; ``episodes``: of the trial and of the training."""
        shared = [name for name in episodes[0] if all(name in episode for episode in episodes)]
        score = gate_score(self._job, {name: float(np.mean([one[name] for one in episodes])) for name in shared})
        if self.score is None or score >= self.score:
            self.score, self.policy = score, policy


def trial_episodes(
    policy: Policy, episodes: int, steps: int, entropy: tuple[int, ...], *, reuse: gymnasium.Env
) -> list[dict[str, float]]:
    """The metrics of stochastic episodes, outside of the replay memory."""
    random = np.random.default_rng(entropy)
    return [run_episode(policy, reuse, steps, random) for _ in range(episodes)]
