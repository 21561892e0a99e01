"""log pi in the discriminator's logit: of the current policy, or of those that made the generators' samples.

The logit f - log pi is right for samples of pi itself. Samples of the last K iterations come from K policies, so their
density is that of the mixture mu = mean_k pi_k. With log pi of the newest policy instead, the best f is

    log rho_E(s, a) - log rho_mu(s) - r_task + (log pi - log mu)(a|s)        (rho: densities of what was visited)

and its last part pays each policy for being what those before it were not: f and generator chase each other around the
expert (docs/validation.md). For K = 1 the two are the same.
"""

import math
from collections.abc import Mapping, Sequence

import torch
from torch import Tensor

from mtcsirl.agents.gaussian import squashed_log_prob
from mtcsirl.agents.networks import NetworkStack
from mtcsirl.episodes.policy import Policy
from mtcsirl.settings import SacSettings
from mtcsirl.transitions import Transitions

ROWS = 500
"""Transitions per pass through the policies, so that layers stay in the processor's cache."""


class Densities:
    """log pi of the demonstrations and of the generators' last transitions, tabulated once per iteration.

    Of K policies each has a table row. What stood in the row of an older policy is kept, so that an iteration costs one
    pass of the newest policies over everything and one of the older ones over the newest rollout.
    """

    def __init__(self, demonstrations: Transitions, sac: SacSettings, policies: int, steps: int) -> None:
        """``demonstrations`` [T, N]; ``policies``: K; ``steps``: environment steps of each policy's rollout."""
        tasks, (observation, action) = len(demonstrations.action), (x.shape[-1] for x in demonstrations[:2])
        self._demonstrations, self._policies, self._steps = demonstrations, policies, steps
        self._device = demonstrations.action.device
        self._bounds = sac.min_log_std, sac.max_log_std
        self._uniform = -action * math.log(2.0)
        self._stack = NetworkStack(tasks, (observation, *sac.hidden_sizes, 2 * action), device=self._device)
        self._workspace = self._stack.workspace(ROWS)
        self._actors: list[Tensor] = []
        self._expert: list[Tensor] = []
        self._generator: list[Tensor] = []

    def add(self, actors: Sequence[Policy] | None, window: Transitions) -> None:
        """Note who made the newest rollout: one policy per task, or None for uniform actions.

        ``window`` [T, n]: the generators' last transitions, whole rollouts, the newest one last.
        """
        n = window.task_reward.shape[1]
        newest = Transitions(*(part[:, -self._steps :] for part in window))
        kept = min(self._policies, max(1, n // self._steps)) - 1
        older = zip(self._actors[-kept:], self._generator[-kept:], strict=True) if kept else ()
        rows = [torch.cat((row, self._log_density(actor, newest)), dim=1)[:, -n:] for actor, row in older]
        self._actors = [*self._actors[-kept:], self._parameters(actors)][-kept - 1 :]
        self._generator = [*rows, self._log_density(self._actors[-1], window)]
        self._expert = [*self._expert[-kept:], self._log_density(self._actors[-1], self._demonstrations)][-kept - 1 :]

    def expert(self) -> Tensor:
        """log density of the demonstrations' actions [T, N]."""
        return _log_mean(self._expert)

    def generator(self) -> Tensor:
        """log density of the window's actions [T, n]."""
        return _log_mean(self._generator)

    def _parameters(self, actors: Sequence[Policy] | None) -> Tensor:
        """The parameters [T, P] of policies; nan stands for uniform actions."""
        if actors is None:
            return torch.full_like(self._stack.parameters, math.nan)
        for task, actor in enumerate(actors):
            for layer, (weight, bias) in enumerate(zip(actor.weights, actor.biases, strict=True)):
                self._stack.weights[layer][task] = torch.from_numpy(weight)
                self._stack.biases[layer][task] = torch.from_numpy(bias)
        return self._stack.parameters.clone()

    def _log_density(self, parameters: Tensor, transitions: Transitions) -> Tensor:
        """log pi(a|s) [T, n] of transitions [T, n]."""
        tasks, count = transitions.task_reward.shape
        if parameters.isnan().any():
            return torch.full((tasks, count), self._uniform, device=self._device)
        self._stack.parameters.copy_(parameters)
        parts = []
        for start in range(0, count, ROWS):
            observation, action = (part[:, start : start + ROWS] for part in transitions[:2])
            whole = observation.shape[1] == ROWS
            workspace = self._workspace if whole else self._stack.workspace(observation.shape[1])
            parts.append(squashed_log_prob(self._stack.forward(observation, workspace), action, *self._bounds))
        return torch.cat(parts, dim=1)

    def state(self) -> dict[str, Tensor]:
        """The tensors that a checkpoint needs."""
        parts = {"actors": self._actors, "expert": self._expert, "generator": self._generator}
        return {name: torch.stack(rows) for name, rows in parts.items() if rows}

    def load_state(self, state: Mapping[str, Tensor]) -> None:
        """Restore what ``state`` gave."""
        self._actors, self._expert, self._generator = (
            [row.to(self._device, copy=True) for row in state.get(name, ())]
            for name in ("actors", "expert", "generator")
        )


def _log_mean(rows: list[Tensor]) -> Tensor:
    """log mean_k exp(row_k)."""
    return torch.logsumexp(torch.stack(rows), dim=0) - math.log(len(rows)) if len(rows) > 1 else rows[0]
