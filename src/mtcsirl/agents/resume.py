"""Checkpoints of a training: one file per agent, the same whether it trains alone or among others."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, Protocol

from torch import Tensor

from mtcsirl.agents.jobs import AgentJob
from mtcsirl.agents.replay import Replay
from mtcsirl.agents.selection import Selection
from mtcsirl.episodes.policy import Policy
from mtcsirl.files.checkpoint import Checkpoint, load_checkpoint, prefixed, save_checkpoint, without_prefix
from mtcsirl.files.provenance import Stopwatch
from mtcsirl.rewards.mixture import PolicyReward


class Resumable(Protocol):
    """What of a training its checkpoints hold; see ``agents.training.Training``."""

    jobs: list[AgentJob]
    checkpoints: list[Path | None]
    learner: Any
    replay: Replay
    reward: PolicyReward
    selections: list[Selection]
    recent: list[list[bool]]
    curves: list[list[tuple[int, str, float]]]
    stopwatch: Stopwatch
    step: int

    def policy(self, agent: int) -> Policy:
        """A frozen copy of an agent as it is now."""


def load(job: AgentJob, file: Path | None) -> Checkpoint | None:
    """What this very job has saved; None, with a line in the log, where the file is damaged or of another run."""
    return None if file is None else load_checkpoint(file, run=job.fingerprint())


def save(training: Resumable) -> None:
    """Write, for every agent, all that the rest of its run depends on; environments start afresh at every episode."""
    for agent, file in enumerate(training.checkpoints):
        if file is not None:
            save_checkpoint(file, *_state(training, agent), run=training.jobs[agent].fingerprint())


def restore(training: Resumable, saved: Sequence[Checkpoint | None], log: Callable[[str], None]) -> None:
    """Put every agent where it was ``saved``; agents in lockstep are of the same step."""
    for agent, checkpoint in enumerate(saved):
        if checkpoint is not None:
            _put(training, agent, *checkpoint)
    if training.step:
        log(f"resumed at step {training.step}")


def _state(training: Resumable, agent: int) -> Checkpoint:
    tensors = prefixed("learner", training.learner.state_dict(agent))
    tensors |= prefixed("replay", training.replay.state_dict(agent))
    tensors |= prefixed("curriculum", training.reward.alpha.state_dict(agent))
    selection = training.selections[agent]
    if selection.policy is not None:
        tensors |= prefixed("best", selection.policy.tensors())
    notes = {
        "spent": training.stopwatch.read(len(training.jobs)),
        "step": training.step,
        "recent": training.recent[agent],
        "counts": bool(training.reward.counts[agent]),
        "curve": training.curves[agent],
        "score": selection.score,
    }
    return tensors, notes


def _put(training: Resumable, agent: int, tensors: dict[str, Tensor], notes: dict[str, Any]) -> None:
    training.stopwatch.add(notes["spent"])
    training.learner.load_state_dict(agent, without_prefix("learner", tensors))
    training.replay.load_state_dict(agent, without_prefix("replay", tensors))
    training.reward.alpha.load_state_dict(agent, without_prefix("curriculum", tensors))
    selection = training.selections[agent]
    if notes["score"] is not None:
        selection.score = tuple(notes["score"])
        selection.policy = training.policy(agent).with_tensors(without_prefix("best", tensors))
    training.step, training.recent[agent] = notes["step"], notes["recent"]
    training.reward.counts[agent] = notes["counts"]
    training.curves[agent] = [(step, name, value) for step, name, value in notes["curve"]]
