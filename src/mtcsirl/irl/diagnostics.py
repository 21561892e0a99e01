"""What to look at when IRL misbehaves: tidy rows of every iteration."""

from collections.abc import Sequence
from math import isfinite
from typing import Any

import torch
from torch import Tensor

from mtcsirl.irl.discriminator import Batch, Discriminator
from mtcsirl.irl.losses import cross_entropy
from mtcsirl.irl.rollout import Flags, World
from mtcsirl.names import DIVERGED
from mtcsirl.transitions import RewardFunction, Transitions

Row = dict[str, Any]

QUANTILES = (0.05, 0.5, 0.95)


def pearson(first: Tensor, second: Tensor) -> Tensor:
    """Pearson's r along the last dimension [..., N] -> [...]; nan where one of the two does not vary."""
    first, second = first.double(), second.double()
    first, second = first - first.mean(-1, keepdim=True), second - second.mean(-1, keepdim=True)
    norms: Tensor = first.norm(dim=-1) * second.norm(dim=-1)
    return (first * second).sum(-1) / norms


def episode_rows(world: World, rollout: Transitions, flags: Flags, first_step: int, episode_steps: int) -> list[Row]:
    """The curve's rows of one iteration: transitions [T, S] and flags [T, S] in episodes of ``episode_steps``.

    ``first_step``: environment steps of each generator before it; an episode's row stands at its last step. An episode
    in which the simulation diverged has failed and says how often.
    """
    _, action, following, task_reward = (part.numpy() for part in rollout.to("cpu"))
    steps, rows = flags.success.shape[1], []
    for start in range(0, steps, episode_steps):
        end = min(start + episode_steps, steps)
        for index, (task, target) in enumerate(world.members):
            part = index, slice(start, end)
            diverged = int(flags.diverged[part].sum())
            solved = bool(flags.success[part].any()) and not diverged
            measured = world.measure_episode(action[part], following[part], task_reward[part], solved)
            measured |= {DIVERGED: float(diverged)} if diverged else {}
            key = {"task": task, "target": target, "step": first_step + end}
            rows += [key | {"metric": metric, "value": value} for metric, value in measured.items()]
    return rows


def discriminator_measures(discriminator: Discriminator, batch: Batch, truth: RewardFunction) -> dict[str, Tensor]:
    """What one discriminator makes of a minibatch: metric -> value [T].

    Accuracies near 1 on both sides mean a saturated discriminator, near 0.5 one asleep or a generator that matches.
    ``pearson_generator`` is r of f with the ground truth on the generators' transitions.
    """
    expert_logit, generator_logit = discriminator.logits(batch)
    expert, generator = discriminator.network(batch.expert), discriminator.network(batch.generator)
    return {
        "accuracy_expert": (expert_logit > 0).float().mean(-1),
        "accuracy_generator": (generator_logit < 0).float().mean(-1),
        "cross_entropy": cross_entropy(expert_logit, generator_logit),
        "logit_expert": expert_logit.mean(-1),
        "logit_generator": generator_logit.mean(-1),
        "f_expert_mean": expert.mean(-1),
        "f_expert_std": expert.std(-1),
        "f_generator_mean": generator.mean(-1),
        "f_generator_std": generator.std(-1),
        "pearson_generator": pearson(generator, truth(batch.generator)),
    }


def log_pi_measures(batch: Batch) -> dict[str, Tensor]:
    """Quantiles of the clamped log pi of both sides: metric -> value [T]."""
    sides = {"expert": batch.expert_log_pi, "generator": batch.generator_log_pi}
    return {
        f"log_pi_{side}_q{round(100 * q):02d}": torch.quantile(log_pi, q, dim=-1)
        for side, log_pi in sides.items()
        for q in QUANTILES
    }


def broken_row(rows: Sequence[Row]) -> Row | None:
    """The first row whose value is not finite. A correlation is none where one side does not vary."""
    return next((row for row in rows if not (isfinite(row["value"]) or row["metric"].startswith("pearson"))), None)


def rows_per_task(
    members: Sequence[tuple[str, int]], step: int, metric: str, values: Tensor, **extra: Any
) -> list[Row]:
    """One tidy row per task of values [T]."""
    return [
        {"task": task, "target": target, "step": step, **extra, "metric": metric, "value": value}
        for (task, target), value in zip(members, values.tolist(), strict=True)
    ]
