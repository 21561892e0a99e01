"""The training loop of every agent that is not a generator: expert, baseline, transfer agent.

One agent or many in lockstep: step, store, update on relabelled minibatches; at the end of an episode report, try the
policy, save. A run that is killed resumes from its last checkpoint and ends with the bytes of one never killed.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import torch

from mtcsirl.agents.held import HeldExplorers
from mtcsirl.agents.jobs import AgentJob, TrainedAgent, gate_score, shared_settings
from mtcsirl.agents.learners import make_learner
from mtcsirl.agents.progress import Progress
from mtcsirl.agents.replay import Replay
from mtcsirl.agents.scripted import ScriptedExplorers
from mtcsirl.episodes.evaluation import measure_episode
from mtcsirl.episodes.gates import gate_verdict, stochastic_means
from mtcsirl.episodes.lockstep import TaskEnvironments, make_environments
from mtcsirl.episodes.policy import Policy
from mtcsirl.files import stop
from mtcsirl.files.checkpoint import load_checkpoint, prefixed, save_checkpoint, without_prefix
from mtcsirl.files.provenance import Stopwatch
from mtcsirl.rewards.mixture import PolicyReward
from mtcsirl.worlds.environments import ACTION_SIZE


def train_agents(
    jobs: Sequence[AgentJob],
    *,
    checkpoints: Sequence[Path] | None = None,
    runs: Sequence[str] | None = None,
    stopwatch: Stopwatch | None = None,
    log: Callable[[str], None] = print,
    events: Path | str | None = None,
    workers: int = 0,
) -> list[TrainedAgent]:
    """Train these agents in lockstep and evaluate them; one job is the ordinary case.

    checkpoint: file to resume from and to save to; the caller removes it when all results stand. run: what the result
    depends on beside the jobs (the code): a checkpoint of another run is not taken up. stopwatch: learns what earlier
    tries spent. events: folder for TensorBoard event files. workers: processes that step the environments and evaluate,
    0 for none.

    Raises UserError when the jobs differ in more than task, target, seed, reward scale, cs_weight, curriculum or
    scripted steps.
    """
    checkpoint, run = (checkpoints[0] if checkpoints else None), (runs[0] if runs else "")
    training = Training(
        jobs, checkpoint=checkpoint, run=run, stopwatch=stopwatch, log=log, events=events, workers=workers
    )
    try:
        training.run()
        return training.finish()
    finally:
        training.close()


class Training:
    """The state of one run of `train_agents`."""

    def __init__(
        self,
        jobs: Sequence[AgentJob],
        *,
        checkpoint: Path | str | None = None,
        run: str = "",
        stopwatch: Stopwatch | None = None,
        log: Callable[[str], None] = print,
        events: Path | str | None = None,
        workers: int = 0,
    ) -> None:
        self.jobs = list(jobs)
        self.settings = shared_settings(self.jobs)
        sac, seeds = self.settings.sac, [job.seed for job in jobs]
        streams = np.random.SeedSequence(seeds).spawn(2)
        self._random = np.random.default_rng(streams[0])
        self.learner = make_learner(len(jobs), sac, seeds)
        sampling_seed = int(streams[1].generate_state(1, np.uint32)[0])
        self.replay = Replay(len(jobs), self.settings.steps, seed=sampling_seed, device=self.learner.device)
        self._reward = PolicyReward([job.mixture() for job in jobs], self.learner.device)
        if self.settings.warm_up_success > 0 and self.settings.warm_up_steps > 0:
            self._reward.counts.zero_()
        self._recent: list[list[bool]] = []
        self.step = 0
        self._best: list[tuple[tuple[float, float, float], Policy] | None] = [None] * len(jobs)
        self._curves: list[list[tuple[int, str, float]]] = [[] for _ in jobs]
        self._checkpoint = None if checkpoint is None else Path(checkpoint)
        self._run = " ".join((run, *(job.fingerprint() for job in jobs)))
        self._stopwatch = stopwatch or Stopwatch()
        tasks = [(job.task, job.target) for job in jobs]
        self.environments: TaskEnvironments = make_environments(tasks, self.settings.environment, workers)
        self._scripted = ScriptedExplorers(
            [job.task for job in jobs],
            seeds,
            [job.settings.scripted_steps for job in jobs],
            [job.settings.scripted_noise for job in jobs],
            self.settings.environment.observation,
        )
        shares = [job.settings.held_share for job in jobs]
        self._held = HeldExplorers(seeds, shares, self.settings.held_steps, self.settings.held_until)
        self._progress = Progress(self.settings.steps, log, events)
        self._log = log

    @stop.deferred()
    def run(self) -> None:
        """Train until the budget ends, from the checkpoint if there is one; stopped, it ends with its episode."""
        if self._checkpoint is not None:
            self._resume(self._checkpoint)
        self._progress.start(self.step)
        while self.step < self.settings.steps:
            started = self.step
            self.episode()
            last = self.step == self.settings.steps
            if self.settings.progress.select_episodes > 0 and (
                last or self._crossed(started, self.settings.progress.select_every)
            ):
                self._try_policies()
            due = stop.requested() or self._crossed(started, self.settings.progress.checkpoint_every)
            if self._checkpoint is not None and due:
                self._save(self._checkpoint)
                stop.stop_here(f"step {self.step}")

    def finish(self) -> list[TrainedAgent]:
        """Evaluate what was kept and judge it by the gates."""
        policies = [self._kept(agent) for agent in range(len(self.jobs))]
        keys = [(job.task, job.target, job.cs_reward, job.seed, job.settings) for job in self.jobs]
        evaluations = self.environments.evaluate([(p, *key) for p, key in zip(policies, keys, strict=True)])
        trained = []
        for job, policy, rows, curve in zip(self.jobs, policies, evaluations, self._curves, strict=True):
            gate = gate_verdict(job.gate, stochastic_means(rows), job.cs_reward, self.settings.gates)
            frame = pd.DataFrame(curve, columns=["step", "metric", "value"])
            trained.append(TrainedAgent(job, policy, frame, rows, gate))
        return trained

    def close(self) -> None:
        """Free the environments."""
        self.environments.close()
        self._progress.close()

    def _crossed(self, started: int, every: int) -> bool:
        return self.step // every > started // every

    def episode(self) -> None:
        """Train through one episode of all agents, then report it."""
        observation, started = self.environments.reset(), self.step
        solved = np.zeros(len(self.jobs), dtype=bool)
        end = min(self.settings.steps, started + self.settings.evaluation.episode_steps)
        while self.step < end:
            action = self._act(observation)
            outcome = self.environments.step(action)
            self.replay.add(observation, action, outcome.next_observation, outcome.task_reward)
            if self._reward.curriculum is not None:
                self._reward.curriculum.add(torch.from_numpy(outcome.task_reward))
            observation = outcome.next_observation
            solved |= outcome.success
            self.step += 1
            self._update()
        if outcome.diverged.any():
            names = {self.jobs[agent].task for agent in np.flatnonzero(outcome.diverged)}
            self._log(f"step {self.step}: the simulation diverged in {', '.join(sorted(names))}")
        self._report(self.step - started, solved)
        self._end_warm_up(solved)

    def _end_warm_up(self, solved: np.ndarray) -> None:
        """f counts, for good, for agents whose recent episodes succeeded often enough, and for all at the latest."""
        if self.step >= self.settings.warm_up_steps:
            self._reward.counts.fill_(1.0)
        own = solved & ~self._scripted.active(max(self.step - 1, 0))
        self._recent = [*self._recent, own.tolist()][-self.settings.warm_up_episodes :]
        if len(self._recent) == self.settings.warm_up_episodes:
            share = torch.tensor(self._recent, dtype=torch.float32).mean(0)
            self._reward.counts[share >= self.settings.warm_up_success] = 1.0

    def _act(self, observation: np.ndarray) -> np.ndarray:
        if self.step < self.settings.sac.random_steps:
            action = self._random.uniform(-1.0, 1.0, (len(self.jobs), ACTION_SIZE)).astype(np.float32)
        else:
            action = self._policy_action(observation)
            self._held.replace(action, self.step)
        self._scripted.replace(action, observation, self.step)
        return action

    def _policy_action(self, observation: np.ndarray) -> np.ndarray:
        return self.learner.act(torch.from_numpy(observation).to(self.learner.device)).cpu().numpy()

    def _update(self) -> None:
        """Catch up with updates_per_step gradient steps per environment step after the random ones."""
        sac = self.settings.sac
        due = int((self.step - sac.random_steps) * sac.updates_per_step)
        while self.learner.updates < due:
            batch = self.replay.sample(sac.minibatch)
            self.learner.update(batch.observation, batch.action, self._reward(batch), batch.next_observation)

    def _report(self, steps: int, solved: np.ndarray) -> None:
        """One curve row per agent and metric: the means of the episode that ends now, and the learner's."""
        episode = [tensor.cpu().numpy() for tensor in self.replay.latest(steps)]
        learner = {name: values.tolist() for name, values in self.learner.metrics().items()}
        measured = []
        for agent, curve in enumerate(self._curves):
            _, action, following, task_reward = (array[agent] for array in episode)
            seen = self.settings.environment.observation
            metrics = measure_episode(action, following, task_reward, bool(solved[agent]), seen)
            metrics |= {name: values[agent] for name, values in learner.items()}
            curve += [(self.step, name, value) for name, value in metrics.items()]
            measured.append(metrics)
        self._progress.report(self.step, measured)

    def _try_policies(self) -> None:
        """Keep the best policy of each agent, by trial episodes outside of the memory and by the last training ones."""
        if all(job.keep == "last" for job in self.jobs):
            return
        trials = [self._trial() for _ in range(self.settings.progress.select_episodes)]
        for agent, job in enumerate(self.jobs):
            episodes = [trial[agent] for trial in trials] + self._training_episodes(agent)
            means = {name: float(np.mean([one[name] for one in episodes])) for name in trials[0][agent]}
            score, best = gate_score(job, means), self._best[agent]
            if best is None or score >= best[0]:
                self._best[agent] = (score, self._policy(agent))

    def _training_episodes(self, agent: int) -> list[dict[str, float]]:
        """The metrics of the last training episodes that the agent's own policy acted in."""
        episodes: dict[int, dict[str, float]] = {}
        for step, name, value in self._curves[agent]:
            if not self._scripted.active(step - 1)[agent]:
                episodes.setdefault(step, {})[name] = value
        wanted = self.settings.progress.select_training_episodes
        return list(episodes.values())[-wanted:] if wanted else []

    def _trial(self) -> list[dict[str, float]]:
        observation = self.environments.reset()
        solved, taken, outcomes = np.zeros(len(self.jobs), dtype=bool), [], []
        for _ in range(self.settings.evaluation.episode_steps):
            taken.append(self._policy_action(observation))
            outcomes.append(self.environments.step(taken[-1]))
            observation = outcomes[-1].next_observation
            solved |= outcomes[-1].success
        following = np.stack([outcome.next_observation for outcome in outcomes], axis=1)
        task_reward = np.stack([outcome.task_reward for outcome in outcomes], axis=1)
        columns = zip(np.stack(taken, axis=1), following, task_reward, solved, strict=True)
        return [measure_episode(*column, self.settings.environment.observation) for column in columns]

    def _policy(self, agent: int) -> Policy:
        return replace(self.learner.policy(agent), observation=self.settings.environment.observation)

    def _kept(self, agent: int) -> Policy:
        best = self._best[agent]
        return self._policy(agent) if best is None or self.jobs[agent].keep == "last" else best[1]

    def _save(self, file: Path) -> None:
        """Write everything that the rest of the run depends on; the environments start afresh at every episode."""
        tensors = prefixed("learner", self.learner.state_dict()) | prefixed("replay", self.replay.state_dict())
        if self._reward.curriculum is not None:
            tensors |= prefixed("curriculum", self._reward.curriculum.state())
        for agent, best in enumerate(self._best):
            if best is not None:
                tensors |= prefixed(f"best/{agent}", best[1].tensors())
        notes = {
            "spent": self._stopwatch.read(),
            "step": self.step,
            "random": self._random.bit_generator.state,
            "recent": self._recent,
            "counts": self._reward.counts.tolist(),
            "curves": self._curves,
            "scores": [None if best is None else best[0] for best in self._best],
        }
        save_checkpoint(file, tensors, notes, run=self._run)

    def _resume(self, file: Path) -> None:
        found = load_checkpoint(file, run=self._run)
        if found is None:
            return
        tensors, notes = found
        self._stopwatch.add(notes["spent"])
        self.learner.load_state_dict(without_prefix("learner", tensors))
        self.replay.load_state_dict(without_prefix("replay", tensors))
        if self._reward.curriculum is not None:
            saved = without_prefix("curriculum", tensors)
            for name, tensor in self._reward.curriculum.state().items():
                tensor.copy_(saved[name])
        for agent, score in enumerate(notes["scores"]):
            if score is not None:
                weights = without_prefix(f"best/{agent}", tensors)
                self._best[agent] = (tuple(score), self._policy(agent).with_tensors(weights))
        self.step, self._random.bit_generator.state = notes["step"], notes["random"]
        self._recent = notes["recent"]
        self._reward.counts.copy_(torch.tensor(notes["counts"]))
        self._curves = [[(step, name, value) for step, name, value in curve] for curve in notes["curves"]]
        self._log(f"resumed at step {self.step}")
