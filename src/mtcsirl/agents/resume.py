"""Checkpoints of a training: one file per agent, the same whether it trains alone or among others."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

from torch import Tensor

from mtcsirl.agents.jobs import AgentJob
from mtcsirl.errors import UserError
from mtcsirl.files.checkpoint import load_checkpoint, prefixed, save_checkpoint, without_prefix

if TYPE_CHECKING:
    from mtcsirl.agents.training import Training

Checkpoint = tuple[dict[str, Tensor], dict[str, Any]]


def step_of(job: AgentJob, file: Path | None, log: Callable[[str], None]) -> int:
    """The step from which this job's file lets it go on, 0 without a file that can be used."""
    found = _load(job, file, log)
    return 0 if found is None else int(found[1]["step"])


def save(training: Training) -> None:
    """Write, for every agent, all that the rest of its run depends on; environments start afresh at every episode."""
    for agent, file in enumerate(training.checkpoints):
        if file is not None:
            save_checkpoint(file, *_state(training, agent))


def restore(training: Training, log: Callable[[str], None]) -> None:
    """Put every agent where its file left it; the files of agents in lockstep are of the same step."""
    silent: Callable[[str], None] = lambda line: None  # noqa: E731
    found = [_load(job, file, silent) for job, file in zip(training.jobs, training.checkpoints, strict=True)]
    for agent, checkpoint in enumerate(found):
        if checkpoint is not None:
            _put(training, agent, *checkpoint)
    if training.step:
        log(f"resumed at step {training.step}")


def _load(job: AgentJob, file: Path | None, log: Callable[[str], None]) -> Checkpoint | None:
    """A checkpoint of this very job; with a damaged or foreign one, a run starts from the beginning and says so."""
    if file is None or not file.is_file():
        return None
    try:
        tensors, notes = load_checkpoint(file)
    except UserError as error:
        log(f"{error}; starting from the beginning")
        return None
    if notes.get("job") != job.fingerprint():
        log(f"{file}: saved by a run with other settings; starting from the beginning")
        return None
    return tensors, notes


def _state(training: Training, agent: int) -> Checkpoint:
    tensors = prefixed("learner", training.learner.state_dict(agent))
    tensors |= prefixed("replay", training.replay.state_dict(agent))
    tensors |= prefixed("curriculum", training.reward.alpha.state_dict(agent))
    selection = training.selections[agent]
    if selection.policy is not None:
        tensors |= prefixed("best", selection.policy.tensors())
    notes = {
        "job": training.jobs[agent].fingerprint(),
        "step": training.step,
        "recent": training.recent[agent],
        "counts": bool(training.reward.counts[agent]),
        "curve": training.curves[agent],
        "score": selection.score,
    }
    return tensors, notes


def _put(training: Training, agent: int, tensors: dict[str, Tensor], notes: dict[str, Any]) -> None:
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
