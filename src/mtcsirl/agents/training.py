"""The training loop of every agent that is not a generator: expert, baseline, transfer agent.

One agent or many in lockstep: step, store, update on relabelled minibatches; at the end of an episode report, try the
policy, save. A batch is invisible: an agent trained among others has the bytes of one trained alone. A run that is
killed resumes from its last checkpoint, alone or among others, and ends with the bytes of one never killed.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import torch

from mtcsirl.agents import resume
from mtcsirl.agents.finite import NotFiniteError, broken_rows, sac_settings
from mtcsirl.agents.held import HeldExplorers
from mtcsirl.agents.jobs import AgentJob, TrainedAgent, shared_settings
from mtcsirl.agents.learners import make_learner
from mtcsirl.agents.progress import Progress
from mtcsirl.agents.replay import Replay
from mtcsirl.agents.scripted import ScriptedExplorers
from mtcsirl.agents.selection import Selection, trial_episodes
from mtcsirl.agents.streams import Purpose, Streams, uniform
from mtcsirl.episodes.evaluation import Row, evaluate, measure_episode
from mtcsirl.episodes.gates import gate_verdict, stochastic_means
from mtcsirl.episodes.lockstep import TaskEnvironments, make_environments
from mtcsirl.episodes.policy import Policy
from mtcsirl.files import stop
from mtcsirl.files.provenance import Stopwatch
from mtcsirl.names import DIVERGED, KEPT, LAST
from mtcsirl.rewards.mixture import PolicyReward
from mtcsirl.worlds.environments import ACTION_SIZE


def train_agents(
    jobs: Sequence[AgentJob],
    *,
    checkpoints: Sequence[Path | str] | None = None,
    stopwatch: Stopwatch | None = None,
    log: Callable[[str], None] = print,
    events: Path | str | None = None,
    workers: int = 0,
) -> list[TrainedAgent]:
    """Train these agents in lockstep and evaluate them; one job is the ordinary case.

    checkpoints: a file of each agent to resume from and to save to, which its run alone would write and take up too;
    who saves the results removes them. Agents that have come equally far go on in lockstep, those of another step after
    them. stopwatch: learns what earlier tries spent. events: folder for TensorBoard event files. workers: processes
    that step the environments and evaluate, 0 for none.

    Raises:
        UserError: the jobs differ in more than task, target, seed, reward scale, cs_weight, curriculum, scripted or
            held actions.
        NotFiniteError: a number is not finite any more; names the agents concerned, and the last checkpoints stay.
    """
    shared_settings(jobs)
    files = [None] * len(jobs) if checkpoints is None else [Path(file) for file in checkpoints]
    saved = [resume.load(job, file) for job, file in zip(jobs, files, strict=True)]
    steps = [0 if found is None else int(found[1]["step"]) for found in saved]
    trained: dict[int, TrainedAgent] = {}
    for step in sorted(set(steps)):
        own = [agent for agent, at in enumerate(steps) if at == step]
        training = Training(
            [jobs[i] for i in own],
            checkpoints=[files[i] for i in own],
            stopwatch=stopwatch,
            log=log,
            events=events,
            workers=workers,
        )
        try:
            resume.restore(training, [saved[i] for i in own], log)
            training.run()
            trained |= zip(own, training.finish(), strict=True)
        except NotFiniteError as error:
            error.agents = tuple(own[agent] for agent in error.agents)
            raise
        finally:
            training.close()
    return [trained[agent] for agent in range(len(jobs))]


class Training:
    """The state of agents that train in lockstep."""

    def __init__(
        self,
        jobs: Sequence[AgentJob],
        *,
        checkpoints: Sequence[Path | None] | None = None,
        stopwatch: Stopwatch | None = None,
        log: Callable[[str], None] = print,
        events: Path | str | None = None,
        workers: int = 0,
    ) -> None:
        self.jobs = list(jobs)
        self.checkpoints: list[Path | None] = list(checkpoints or [None] * len(self.jobs))
        self.settings = settings = shared_settings(self.jobs)
        seeds, own = [job.seed for job in jobs], [job.settings for job in jobs]
        self.step = 0
        self.learner = make_learner(len(jobs), settings.sac, seeds)
        self.replay = Replay(seeds, settings.steps, device=self.learner.device)
        self.reward = PolicyReward(
            [job.mixture() for job in jobs],
            self.learner.device,
            window=settings.curriculum_window,
            maximum=settings.curriculum_maximum,
        )
        if settings.warm_up_success > 0 and settings.warm_up_steps > 0:
            self.reward.counts[:] = False
        self.recent: list[list[bool]] = [[] for _ in jobs]
        """Whether each agent's last episodes succeeded, as many as its warm-up looks at."""
        self.selections = [Selection(job) for job in jobs]
        self.curves: list[list[tuple[int, str, float]]] = [[] for _ in jobs]
        tasks = [(job.task, job.target) for job in jobs]
        self.environments: TaskEnvironments = make_environments(tasks, settings.environment, workers)
        self._random_actions = Streams(seeds, Purpose.RANDOM_ACTIONS, (ACTION_SIZE,), uniform)
        self._scripted = ScriptedExplorers(
            [job.task for job in jobs],
            seeds,
            [one.scripted_steps for one in own],
            [one.scripted_noise for one in own],
            settings.environment.observation,
        )
        until = int(settings.held_until * settings.steps)
        self._held = HeldExplorers(seeds, [one.held_share for one in own], settings.held_steps, until)
        self._progress = Progress(settings.steps, log, events)
        self.stopwatch = stopwatch or Stopwatch()
        self._log = log

    @stop.deferred()
    def run(self) -> None:
        """Train until the budget ends; stopped, it ends with its episode."""
        self._progress.start(self.step)
        while self.step < self.settings.steps:
            started = self.step
            self.episode()
            if self.step == self.settings.steps or self._crossed(started, self.settings.progress.select_every):
                self._try_policies()
            if stop.requested() or self._crossed(started, self.settings.progress.checkpoint_every):
                resume.save(self)
                if any(self.checkpoints):
                    stop.stop_here(f"step {self.step}")

    def finish(self) -> list[TrainedAgent]:
        """Evaluate what was kept and judge it by the gates."""
        import pandas as pd

        last = [self.policy(agent) for agent in range(len(self.jobs))]
        kept = [chosen.policy or own for chosen, own in zip(self.selections, last, strict=True)]
        evaluations = self._evaluate(kept)
        gates = [
            gate_verdict(job.gate, stochastic_means(rows), job.cs_reward, job.settings.gates)
            for job, rows in zip(self.jobs, evaluations, strict=True)
        ]
        others = [own if one.other_than(own) else None for one, own in zip(self.selections, last, strict=True)]
        for one, rows, more in zip(self.selections, evaluations, self._evaluate(others, LAST), strict=True):
            rows += more or [row | {KEPT: LAST} for row in rows if one.wanted]
        batch = tuple(job.label for job in self.jobs)
        frames = [pd.DataFrame(curve, columns=["step", "metric", "value"]) for curve in self.curves]
        return [
            TrainedAgent(*parts, lockstep=batch)
            for parts in zip(self.jobs, kept, frames, evaluations, gates, strict=True)
        ]

    def _evaluate(self, policies: Sequence[Policy | None], *which: str) -> list[list[Row]]:
        """The evaluation rows of a policy of each agent, none where there is no policy."""
        arguments = [
            None if policy is None else (policy, job.task, job.target, job.cs_reward, job.seed, job.settings, *which)
            for policy, job in zip(policies, self.jobs, strict=True)
        ]
        return [rows or [] for rows in self.environments.each(evaluate, arguments)]

    def close(self) -> None:
        """Free the environments."""
        self.environments.close()
        self._progress.close()

    def _crossed(self, started: int, every: int) -> bool:
        return self.step // every > started // every

    def episode(self) -> None:
        """Train through one episode of all agents, then report it.

        Where a simulation diverges its agent starts over in the middle of the episode, which counts as failed.
        """
        observation, started = self.environments.reset(), self.step
        solved, diverged = np.zeros(len(self.jobs), dtype=bool), np.zeros(len(self.jobs), dtype=int)
        end = min(self.settings.steps, started + self.settings.evaluation.episode_steps)
        while self.step < end:
            action = self._act(observation)
            self._stop_at(broken_rows(action), "the action")
            outcome = self.environments.step(action)
            self._stop_at(broken_rows(outcome.task_reward), "the task reward")
            self._stop_at(broken_rows(outcome.next_observation), "the observation")
            self.replay.add(observation, action, outcome.next_observation, outcome.task_reward, outcome.diverged)
            self.reward.alpha.add(torch.from_numpy(outcome.task_reward))
            observation = outcome.next_observation
            solved |= outcome.success
            diverged += outcome.diverged
            self.step += 1
            self._update()
        for agent, what in self.learner.broken_agents().items():
            self._stop_at([agent], what)
        solved &= diverged == 0
        self._report(self.step - started, solved, diverged)
        self._end_warm_up(solved)

    def _stop_at(self, agents: Sequence[int], what: str) -> None:
        """End the run if any agent is concerned: nothing may be made of a number that is not finite.

        Raises NotFiniteError.
        """
        if not agents:
            return
        job, file = self.jobs[agents[0]], self.checkpoints[agents[0]]
        left = f"; {file} is from before" if file is not None and file.is_file() else ""
        raise NotFiniteError(
            f"{job.label}: {what} became non-finite at step {self.step} with {sac_settings(job.settings.sac)}, "
            f"cs_weight {job.settings.cs_weight:g}: lower a learning rate or the reward's scale{left}",
            agents,
        )

    def _end_warm_up(self, solved: np.ndarray) -> None:
        """f counts, for good, for agents whose recent episodes succeeded often enough, and for all at the latest."""
        own = solved & ~self._scripted.active(max(self.step - 1, 0))
        wanted, late = self.settings.warm_up_episodes, self.step >= self.settings.warm_up_steps
        for agent, success in enumerate(own.tolist()):
            recent = self.recent[agent] = [*self.recent[agent], success][-wanted:]
            enough = len(recent) == wanted and sum(recent) / wanted >= self.settings.warm_up_success
            self.reward.counts[agent] |= late or enough

    def _act(self, observation: np.ndarray) -> np.ndarray:
        if self.step < self.settings.sac.random_steps:
            action = 2.0 * self._random_actions.draw(self.step).numpy() - 1.0
        else:
            action = self.learner.act(torch.from_numpy(observation).to(self.learner.device)).cpu().numpy()
            self._held.replace(action, self.step)
        self._scripted.replace(action, observation, self.step)
        return action

    def _update(self) -> None:
        """Catch up with updates_per_step gradient steps per environment step after the random ones."""
        sac = self.settings.sac
        due = int((self.step - sac.random_steps) * sac.updates_per_step)
        while self.learner.updates < due:
            batch = self.replay.sample(sac.minibatch)
            self.learner.update(batch.observation, batch.action, self.reward(batch), batch.next_observation)

    def _report(self, steps: int, solved: np.ndarray, diverged: np.ndarray) -> None:
        """One curve row per agent and metric: the means of the episode that ends now, and the learner's."""
        episode = [tensor.cpu().numpy() for tensor in self.replay.latest(steps)]
        learner = {name: values.tolist() for name, values in self.learner.metrics().items()}
        measured = []
        for agent, curve in enumerate(self.curves):
            _, action, following, task_reward = (array[agent] for array in episode)
            seen = self.settings.environment.observation
            metrics = measure_episode(action, following, task_reward, bool(solved[agent]), seen)
            metrics |= {name: values[agent] for name, values in learner.items()}
            if diverged[agent]:
                metrics[DIVERGED] = float(diverged[agent])
                self._log(f"{self.jobs[agent].label}: the simulation diverged before step {self.step}")
            for name, value in metrics.items():
                self._stop_at([] if np.isfinite(value) else [agent], f"the {name.replace('_', ' ')}")
            curve += [(self.step, name, value) for name, value in metrics.items()]
            measured.append(metrics)
        self._progress.report(self.step, measured)

    def _try_policies(self) -> None:
        """Keep the best policies, by trial episodes outside of the memory and by the last training ones."""
        policies = [self.policy(agent) if one.wanted else None for agent, one in enumerate(self.selections)]
        pairs = list(zip(self.selections, policies, strict=True))
        wanted = [None if policy is None else one.trial(policy, self.step) for one, policy in pairs]
        trials = self.environments.each(trial_episodes, wanted)
        for agent, ((one, policy), episodes) in enumerate(zip(pairs, trials, strict=True)):
            if policy is not None:
                one.judge(policy, episodes + self._training_episodes(agent))

    def _training_episodes(self, agent: int) -> list[dict[str, float]]:
        """The metrics of the last training episodes that the agent's own policy acted in."""
        episodes: dict[int, dict[str, float]] = {}
        for step, name, value in self.curves[agent]:
            if not self._scripted.active(step - 1)[agent]:
                episodes.setdefault(step, {})[name] = value
        wanted = self.settings.progress.select_training_episodes
        return list(episodes.values())[-wanted:] if wanted else []

    def policy(self, agent: int) -> Policy:
        """A frozen copy of an agent as it is now."""
        return replace(self.learner.policy(agent), observation=self.settings.environment.observation)
