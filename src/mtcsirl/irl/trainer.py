"""Algorithms 1 and 2: generators and discriminators in turn, T tasks in one process."""

import math
from collections.abc import Mapping, Sequence

import numpy as np
import torch
from torch import Tensor

from mtcsirl.agents.finite import NotFiniteError, broken_agents, broken_rows, discriminator_settings, sac_settings
from mtcsirl.agents.learners import make_learner
from mtcsirl.agents.replay import Replay
from mtcsirl.agents.scripted import ScriptedExplorers
from mtcsirl.agents.streams import Purpose, Streams, uniform
from mtcsirl.episodes.lockstep import Outcome
from mtcsirl.irl.densities import Densities
from mtcsirl.irl.diagnostics import (
    Row,
    broken_row,
    discriminator_measures,
    episode_rows,
    log_pi_measures,
    rows_per_task,
)
from mtcsirl.irl.discriminator import Batch, Discriminator, Method
from mtcsirl.irl.losses import clamp_log_pi
from mtcsirl.irl.rollout import Flags, World, collect, gather
from mtcsirl.rewards.curriculum import R_MAX, Alpha
from mtcsirl.rewards.networks import RewardNetwork
from mtcsirl.settings import SacSettings
from mtcsirl.settings.runs import IrlRunSettings
from mtcsirl.transitions import Transitions

DIAGNOSED = 1024
"""Transitions per side and task that the diagnostics of an iteration look at."""
CENTRED = 5_000
"""Last transitions of each generator over which the mean of f is taken."""


class IrlTrainer:
    """One IRL run.

    An iteration is, as printed: every generator samples ``steps_per_iteration`` steps; for t in T, D_updates
    discriminator updates on task t; G_updates updates of generator t on relabelled samples. A generator's update
    touches neither another generator nor a discriminator, and log pi_t of task t's samples is that of the policy at
    the start of its turn. So all discriminator updates may come first, if generator t later earns the f that stood
    after its own turn, and all generators may then learn in one tensor program: ``schedule: as_printed`` does this and
    equals the printed order. ``schedule: batched`` also joins the tasks' discriminator updates: D_updates steps on the
    summed loss of all tasks instead of T x D_updates steps on one task's loss each. For T = 1, and for the per-task
    rewards of MT-CSIRL+LT, the two are the same; for a shared f the batched one takes fewer steps and no task is last.
    """

    def __init__(
        self, method: Method, world: World, demonstrations: Transitions, settings: IrlRunSettings, seed: int
    ) -> None:
        """``demonstrations`` [T, N] are seen as the agent sees them."""
        self.method, self.world, self.settings = method, world, settings
        self.irl, self.seed = settings.irl, seed
        self.iteration = 0
        self._device = torch.device(settings.sac.device)
        self._demonstrations = demonstrations.to(self._device)
        tasks, steps = len(world.members), self.irl.steps_per_iteration
        *seeds, own = (int(n) for n in np.random.SeedSequence(seed).generate_state(tasks + 1))
        state, action = demonstrations.observation.shape[-1], demonstrations.action.shape[-1]
        self.sac = make_learner(tasks, self._first_sac(), seeds, observation_size=state, action_size=action)
        capacity = min(self.irl.generator_memory, self.iterations * steps)
        self.replay = Replay(seeds, capacity, observation_size=state, action_size=action, device=self._device)
        self._random_actions = Streams(seeds, Purpose.RANDOM_ACTIONS, (action,), uniform)
        maximum = R_MAX if self.irl.curriculum_maximum == "task" else demonstrations.task_reward.mean(dim=1)
        weighted = [self.irl.curriculum and method.uses_curriculum] * tasks
        self.alpha = Alpha([self.irl.cs_weight] * tasks, weighted, self.irl.curriculum_window, maximum)
        """The weight of f in each generator's reward [T]."""
        self._policies_mixed = self.irl.generator_replay if self.irl.logit_density == "mixture" else 1
        self.densities = Densities(self._demonstrations, settings.sac, policies=self._policies_mixed, steps=steps)
        self._scripted = self._explorers(seeds)
        self.random = torch.Generator(self._device).manual_seed(own)
        self._paying: dict[str, RewardNetwork] = {}
        self._centres: dict[str, Tensor] = {}
        self.curve: list[Row] = []
        self.diagnostics: list[Row] = []

    @property
    def iterations(self) -> int:
        """All iterations, the same for every method: one without the task reward spends its warm-up on IRL."""
        return self.irl.warm_up_iterations + self.irl.iterations

    @property
    def _warming_up(self) -> bool:
        return self.method.knows_task_reward and self.iteration < self.irl.warm_up_iterations

    def iterate(self) -> None:
        """One outer iteration of Algorithm 1 or 2.

        Raises:
            NotFiniteError: a number of a generator or a discriminator is not finite any more.
        """
        steps, episode = self.irl.steps_per_iteration, self.settings.evaluation.episode_steps
        random, rows = self._acts_randomly, (len(self.curve), len(self.diagnostics))
        flags = collect(self.world.environments, self._act, steps, episode, self._on_step)
        wanted = not self._warming_up or self.iteration + self._policies_mixed > self.irl.warm_up_iterations
        if wanted and self.iteration >= self._scripted_rollouts:
            self._tabulate(random)
        if not self._warming_up:
            self._note_discriminators(self._update_discriminators())
        for _ in range(self.irl.generator_updates):
            sample = self.replay.sample(self.settings.sac.minibatch)
            reward = self.settings.sac.reward_scale * self.policy_reward(sample)
            self.sac.update(sample.observation, sample.action, reward, sample.next_observation)
        for generator, what in self.sac.broken_agents().items():
            self._stop_at(what, [generator])
        self._note_generators(self.replay.latest(steps), flags)
        if row := broken_row([*self.curve[rows[0] :], *self.diagnostics[rows[1] :]]):
            self._stop_at(row["metric"], [self.world.members.index((row["task"], row["target"]))])
        self.iteration += 1
        if self.iteration == self.irl.warm_up_iterations:
            self._fix_temperature()

    def _first_sac(self) -> SacSettings:
        """The generators' settings as they start: their warm-up may have a temperature of its own."""
        sac = self.settings.sac
        if self._warming_up and self.irl.warm_up_temperature == "automatic":
            return sac.model_copy(update={"temperature": "automatic"})
        return sac

    def start_at(self, iteration: int) -> None:
        """Go on from this iteration, once its state is restored."""
        self.iteration = iteration
        if not self._warming_up:
            self._fix_temperature()

    def _fix_temperature(self) -> None:
        """From the first iteration of IRL on, a fixed temperature is fixed."""
        if self.settings.sac.temperature != "automatic":
            self.sac.fix_temperature(float(self.settings.sac.temperature))

    def _explorers(self, seeds: Sequence[int]) -> ScriptedExplorers:
        """Scripted first actions belong to a warm-up: they are knowledge of the task."""
        tasks = [task for task, _ in self.world.members]
        warm_up = self.irl.warm_up_iterations * self.irl.steps_per_iteration
        most = min(warm_up, self.replay.capacity) if self.method.knows_task_reward else 0
        steps = [min(most, self.settings.scripted_steps.get(task, 0)) for task in tasks]
        noise = [self.settings.scripted_noise] * len(tasks)
        return ScriptedExplorers(tasks, seeds, steps, noise, self.settings.environment.observation)

    @property
    def _scripted_rollouts(self) -> int:
        """How many of the first rollouts hold scripted actions of any generator."""
        return -(-int(self._scripted.steps.max()) // self.irl.steps_per_iteration)

    @property
    def temperature(self) -> Tensor:
        """The entropy temperature of each generator [T], in units of the policy reward."""
        return self.sac.temperature / self.settings.sac.reward_scale

    # --- generators ---------------------------------------------------------------------------------------------

    @property
    def _acts_randomly(self) -> bool:
        return self.replay.size < min(self.settings.sac.random_steps, self.replay.capacity)

    def _act(self, observation: np.ndarray) -> np.ndarray:
        if self._acts_randomly:
            action = 2.0 * self._random_actions.draw(self.replay.size).numpy() - 1.0
        else:
            action = self.sac.act(torch.from_numpy(observation).float().to(self._device)).cpu().numpy()
        self._scripted.replace(action, observation, self.replay.size)
        self._stop_at("the action", broken_rows(action))
        return action

    def _on_step(self, observation: np.ndarray, action: np.ndarray, outcome: Outcome) -> None:
        self._stop_at("the task reward", broken_rows(outcome.task_reward))
        self._stop_at("the observation", broken_rows(outcome.next_observation))
        self.replay.add(observation, action, outcome.next_observation, outcome.task_reward, outcome.diverged)
        self.alpha.add(torch.from_numpy(outcome.task_reward))

    def policy_reward(self, transitions: Transitions) -> Tensor:
        """What the generators are paid for transitions [T, B], under the rewards of this moment."""
        task_reward = self.irl.task_reward_scale * transitions.task_reward
        if self._warming_up:
            return task_reward
        learned = {name: network(transitions) - self._centres[name] for name, network in self._paying.items()}
        return self.method.policy_reward(task_reward, learned, self.alpha().to(self._device).unsqueeze(1))

    def centre(self, network: RewardNetwork) -> Tensor:
        """The mean of a learned reward over each generator's last transitions [T, 1], or 0 without centring.

        A constant in every reward changes no preference between policies, but shifts the critics' target by a hundred
        times (1 / (1 - gamma)) its value: f starts near log pi - r_task, about -13, whatever it has to say.
        """
        if not self.irl.centre:
            return torch.zeros(len(self.world.members), 1, device=self._device)
        latest = self.replay.latest(min(CENTRED, self.replay.size))
        return network(latest).mean(dim=1, keepdim=True)

    # --- discriminators -----------------------------------------------------------------------------------------

    def _update_discriminators(self) -> dict[str, float]:
        """D_updates per task; returns the mean norm of each discriminator's gradients."""
        batches = self._batches(self.irl.discriminator_updates, self.irl.discriminator.minibatch)
        as_printed = self.irl.schedule == "as_printed"
        norms = {}
        for name, discriminator in self.method.discriminators.items():
            update = self._update_as_printed if as_printed else self._update_batched
            self._paying[name], norms[name] = update(discriminator, batches)
            parameters = discriminator.network.parameters.detach()
            if not math.isfinite(norms[name]) or broken_agents({name: parameters}):
                self._stop_at(f"discriminator {name}", range(len(self.world.members)))
            self._centres[name] = self.centre(self._paying[name])
        return norms

    @staticmethod
    def _update_batched(discriminator: Discriminator, batches: list[Batch]) -> tuple[RewardNetwork, float]:
        norms = [discriminator.update(batch)[1] for batch in batches]
        return discriminator.network, float(torch.stack(norms).mean())

    def _update_as_printed(self, discriminator: Discriminator, batches: list[Batch]) -> tuple[RewardNetwork, float]:
        """Task after task; the returned network holds, for each task, f as it stood after that task's turn."""
        if discriminator.network.members > 1:
            return self._update_batched(discriminator, batches)
        norms, after_turn = [], []
        for task in range(len(self.world.members)):
            norms += [discriminator.update(batch.only(task))[1] for batch in batches]
            after_turn.append(discriminator.network.parameters.detach().clone())
        paying = RewardNetwork.from_parameters(discriminator.network.architecture, torch.cat(after_turn))
        return paying, float(torch.stack(norms).mean())

    def _window(self) -> Transitions:
        """The generators' transitions [T, n] that discriminators see: whole rollouts of their own, the newest last."""
        own = self.iteration + 1 - self._scripted_rollouts
        wanted = min(own, self.irl.generator_replay) * self.irl.steps_per_iteration
        return self.replay.latest(min(wanted, self.replay.size))

    def _tabulate(self, random: bool) -> None:
        """Note the policies that made the newest rollout; ``random``: it began with uniform actions."""
        uniform = random and self.irl.logit_density == "mixture"
        actors = None if uniform else [self.sac.policy(agent) for agent in range(len(self.world.members))]
        self.densities.add(actors, self._window())

    def _batches(self, count: int, minibatch: int) -> list[Batch]:
        """``count`` minibatches of expert and generator transitions [T, minibatch] with their log pi."""
        temperature = self.temperature.unsqueeze(1)
        if self.irl.logit_temperature == "as_printed":
            temperature = torch.ones_like(temperature)
        sides = []
        for held, log_pi in (
            (self._demonstrations, self.densities.expert()),
            (self._window(), self.densities.generator()),
        ):
            log_pi = clamp_log_pi(log_pi, self.irl.discriminator.log_pi_clamp)
            shape = count, len(log_pi), minibatch
            index = torch.randint(log_pi.shape[1], shape, generator=self.random, device=self._device)
            sides.append([(self._scaled(gather(held, one)), log_pi.gather(1, one)) for one in index])
        return [
            Batch(expert, generator, expert_log_pi, generator_log_pi, temperature)
            for (expert, expert_log_pi), (generator, generator_log_pi) in zip(*sides, strict=True)
        ]

    def _scaled(self, transitions: Transitions) -> Transitions:
        return transitions._replace(task_reward=self.irl.task_reward_scale * transitions.task_reward)

    def _stop_at(self, what: str, generators: Sequence[int]) -> None:
        """End the run if any generator is concerned: nothing may be made of a number that is not finite."""
        if generators:
            task, target = self.world.members[generators[0]]
            who = what if what.startswith("discriminator") else f"{what} of {task}-t{target}"
            settings = f"{discriminator_settings(self.irl.discriminator)}, {sac_settings(self.settings.sac)}"
            raise NotFiniteError(
                f"{self.method.name} s{self.seed}: {who} became non-finite in iteration {self.iteration + 1}, step "
                f"{self.replay.size}, with {settings}: lower a learning rate or a scale",
                generators,
            )

    # --- reporting ------------------------------------------------------------------------------------------------

    @property
    def _steps_after(self) -> int:
        """Environment steps of each generator when this iteration ends."""
        return (self.iteration + 1) * self.irl.steps_per_iteration

    def _note_discriminators(self, norms: Mapping[str, float]) -> None:
        """Rows on the discriminators, between their updates and the generators'."""
        members, (batch,) = self.world.members, self._batches(1, DIAGNOSED)
        for metric, values in log_pi_measures(batch).items():
            self.diagnostics += rows_per_task(members, self._steps_after, metric, values, discriminator="")
        for name, discriminator in self.method.discriminators.items():
            measures = discriminator_measures(discriminator, batch, self.world.truth)
            shared = {"gradient_norm": torch.tensor(norms[name]), **discriminator.loss.state()}
            measures |= {metric: value.expand(len(members)) for metric, value in shared.items()}
            for metric, values in measures.items():
                self.diagnostics += rows_per_task(members, self._steps_after, metric, values, discriminator=name)

    def _note_generators(self, rollout: Transitions, flags: Flags) -> None:
        """Rows on the episodes and on the generators' learning."""
        members, start = self.world.members, self.iteration * self.irl.steps_per_iteration
        self.curve += episode_rows(self.world, rollout, flags, start, self.settings.evaluation.episode_steps)
        learning = self.sac.metrics() | {"temperature": self.temperature, "curriculum": self.alpha()}
        for metric in ("temperature", "curriculum"):
            self.curve += rows_per_task(members, self._steps_after, metric, learning[metric])
        for metric, values in learning.items():
            self.diagnostics += rows_per_task(members, self._steps_after, metric, values, discriminator="")
