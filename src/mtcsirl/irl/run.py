"""One IRL run from demonstrations to artefacts: reward, generators, curves, diagnostics, evaluation."""

from __future__ import annotations

import dataclasses
import functools
import hashlib
import json
import logging
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from mtcsirl.episodes.demonstrations import load_demonstrations
from mtcsirl.episodes.evaluation import COLUMNS, evaluate, measure_episode
from mtcsirl.episodes.gates import gate_verdict, stochastic_means
from mtcsirl.episodes.lockstep import make_environments
from mtcsirl.episodes.policy import Policy, save_policy
from mtcsirl.errors import UserError
from mtcsirl.files import stop
from mtcsirl.files.checkpoint import load_checkpoint, save_checkpoint
from mtcsirl.files.provenance import Stopwatch
from mtcsirl.files.storage import checksum, write_csv, write_json, write_parquet
from mtcsirl.irl.methods import METHODS, make_method
from mtcsirl.irl.methods.base import Setup
from mtcsirl.irl.resume import load_state, state
from mtcsirl.irl.rollout import World
from mtcsirl.irl.trainer import IrlTrainer
from mtcsirl.names import CURVE_COLUMNS, DIAGNOSTIC_COLUMNS
from mtcsirl.rewards.adapter import ground_truth
from mtcsirl.rewards.ground_truth import COMMON_SENSE_REWARDS
from mtcsirl.rewards.learned import LearnedReward, save_learned_reward
from mtcsirl.settings.runs import IrlRunSettings
from mtcsirl.transitions import Transitions
from mtcsirl.worlds.environments import OBSERVATION_MAPS

if TYPE_CHECKING:
    import pandas as pd

CHECKPOINT = "checkpoint.safetensors"
SAMPLED_ROLLOUTS = 10
"""Last rollouts of each generator that ``samples.parquet`` keeps."""

_LOG = logging.getLogger(__name__)


def learn_reward(
    folder: Path | str,
    method: str,
    cs_reward: str,
    demonstrations: Sequence[Path | str],
    seed: int,
    settings: IrlRunSettings,
    *,
    about: Mapping[str, Any] | None = None,
    run: str = "",
    stopwatch: Stopwatch | None = None,
    workers: int = 0,
) -> None:
    """Learn a reward from T files of demonstrations, one per (task, target), and write the run into ``folder``.

    ``cs_reward`` names what the experts were trained with; it is measured, never trained on. A checkpoint in
    ``folder`` of the same run is taken up, and the run ends with the bytes of one that was never stopped; the caller
    removes it when all results stand. ``run``: what the result depends on beside the arguments (the code): a checkpoint
    of another run is not taken up. ``stopwatch`` learns what earlier tries spent. ``workers``: processes that step the
    environments; they change no byte.

    Raises:
        UserError: unknown method or cs-reward; unreadable demonstrations; a number that is not finite any more.
    """
    folder = Path(folder)
    trainer = make_trainer(method, cs_reward, demonstrations, seed, settings, workers=workers)
    try:
        run = _fingerprint(run, method, cs_reward, [checksum(file) for file in demonstrations], seed, settings)
        _train(trainer, folder / CHECKPOINT, run, stopwatch or Stopwatch())
        _write(trainer, folder, cs_reward, seed, dict(about or {}))
    finally:
        trainer.world.environments.close()


def make_trainer(
    method: str,
    cs_reward: str,
    demonstrations: Sequence[Path | str],
    seed: int,
    settings: IrlRunSettings,
    *,
    workers: int = 0,
) -> IrlTrainer:
    """The trainer of a run on Meta-World; see ``learn_reward``."""
    if method not in METHODS:
        raise UserError(f"method: unknown {method!r}; known: {', '.join(METHODS)}")
    if cs_reward not in COMMON_SENSE_REWARDS:
        raise UserError(f"cs_reward: unknown {cs_reward!r}; known: {', '.join(COMMON_SENSE_REWARDS)}")
    observation = settings.environment.observation
    episodes = settings.demonstration_episodes
    experts = load_demonstrations(demonstrations, episodes=episodes, observation=observation, cs_reward=cs_reward)
    world = World(
        members=experts.members,
        environments=make_environments(experts.members, settings.environment, workers),
        truth=ground_truth(cs_reward, observation),
        measure_episode=functools.partial(measure_episode, observation=observation),
    )
    setup = Setup(
        irl=settings.irl,
        tasks=len(experts.members),
        seed=seed,
        discount=settings.sac.discount,
        device=settings.sac.device,
    )
    return IrlTrainer(make_method(method, setup), world, experts.transitions, settings, seed)


@stop.deferred()
def _train(trainer: IrlTrainer, checkpoint: Path, run: str, stopwatch: Stopwatch) -> None:
    """Iterate to the end, from the checkpoint if it is of this very run; stopped, it ends with its iteration."""
    settings = trainer.settings
    _resume(trainer, checkpoint, run, stopwatch)
    every = max(1, settings.progress.checkpoint_every // settings.irl.steps_per_iteration)
    while trainer.iteration < trainer.iterations:
        trainer.iterate()
        _LOG.info("%s", _progress(trainer))
        due = trainer.iteration % every == 0 and trainer.iteration < trainer.iterations
        if due or stop.requested():
            rows = {"curve": trainer.curve, "diagnostics": trainer.diagnostics}
            save_checkpoint(checkpoint, state(trainer), rows | {"spent": stopwatch.read()}, run=run)
            stop.stop_here(f"iteration {trainer.iteration}")


def _progress(trainer: IrlTrainer) -> str:
    import pandas as pd

    last = [row for row in trainer.curve if row["step"] == trainer.curve[-1]["step"]]
    means = pd.DataFrame(last).groupby("metric", sort=False)["value"].mean()
    text = ", ".join(f"{metric} {value:.3g}" for metric, value in means.items())
    return f"{trainer.method.name} iteration {trainer.iteration}/{trainer.iterations}: {text}"


def _fingerprint(*parts: Any) -> str:
    """Changes with anything that the result of a run depends on."""
    plain = [part.model_dump(mode="json") if isinstance(part, IrlRunSettings) else part for part in parts]
    return hashlib.sha256(json.dumps(plain, sort_keys=True).encode()).hexdigest()


def _resume(trainer: IrlTrainer, checkpoint: Path, run: str, stopwatch: Stopwatch) -> None:
    saved = load_checkpoint(checkpoint, run=run)
    if saved is None:
        return
    tensors, notes = saved
    load_state(trainer, tensors)
    trainer.curve, trainer.diagnostics = notes["curve"], notes["diagnostics"]
    stopwatch.add(notes["spent"])
    _LOG.info("resumed at iteration %d", trainer.iteration)


def _learned(trainer: IrlTrainer, cs_reward: str, about: dict[str, Any]) -> LearnedReward:
    discriminators = trainer.method.discriminators
    f, task = discriminators["f"].network, discriminators["task"].network if "task" in discriminators else None
    return LearnedReward(
        network=f,
        method=trainer.method.name,
        cs_reward=cs_reward,
        observation=trainer.settings.environment.observation,
        members=trainer.world.members,
        offset=float(trainer.centre(f).mean()),
        task_network=task,
        task_offsets=tuple(trainer.centre(task).squeeze(1).tolist()) if task else (),
        about=about,
    )


def _write(trainer: IrlTrainer, folder: Path, cs_reward: str, seed: int, about: dict[str, Any]) -> None:
    import pandas as pd

    write_csv(folder / "curve.csv", pd.DataFrame(trainer.curve, columns=list(CURVE_COLUMNS)))
    write_csv(folder / "diagnostics.csv", pd.DataFrame(trainer.diagnostics, columns=list(DIAGNOSTIC_COLUMNS)))
    write_parquet(folder / "samples.parquet", _samples(trainer))
    _evaluate(trainer, folder, cs_reward, seed)
    save_learned_reward(_learned(trainer, cs_reward, {"seed": seed, **about}), folder)


def _evaluate(trainer: IrlTrainer, folder: Path, cs_reward: str, seed: int) -> None:
    """Save and evaluate each generator; the run passes its gate if every generator does."""
    import pandas as pd

    settings, rows, verdicts = trainer.settings, [], []
    for index, (task, target) in enumerate(trainer.world.members):
        policy = _policy(trainer, index)
        save_policy(policy, folder / "policies", f"{task}-t{target}")
        own = evaluate(policy, task, target, cs_reward, seed, settings)
        rows += own
        verdict = gate_verdict("generator", stochastic_means(own), cs_reward, settings.gates)
        verdicts.append({"task": task, "target": target, **verdict})
    write_csv(folder / "evaluation.csv", pd.DataFrame(rows, columns=list(COLUMNS)))
    write_json(
        folder / "gate.json",
        {
            "gate": "generator",
            "passed": all(verdict["passed"] for verdict in verdicts),
            "success": float(np.mean([verdict["success"] for verdict in verdicts])),
            "metric": float(np.mean([verdict["metric"] for verdict in verdicts])),
            "limits": verdicts[0]["limits"],
            "diverged": sum(verdict["diverged"] for verdict in verdicts),
            "members": verdicts,
        },
    )


def _policy(trainer: IrlTrainer, index: int) -> Policy:
    return dataclasses.replace(trainer.sac.policy(index), observation=trainer.settings.environment.observation)


def _samples(trainer: IrlTrainer) -> pd.DataFrame:
    """The last rollouts of every generator in raw units, columns as in demonstrations (without success)."""
    import pandas as pd

    length = trainer.irl.steps_per_iteration
    steps = min(SAMPLED_ROLLOUTS * length, trainer.replay.size)
    seen = OBSERVATION_MAPS[trainer.settings.environment.observation]
    latest = trainer.replay.latest(steps).to("cpu")
    frames = []
    for index, (task, target) in enumerate(trainer.world.members):
        own = Transitions(*(part[index] for part in latest))
        episode_length = min(length, trainer.settings.evaluation.episode_steps)
        frames.append(
            pd.DataFrame(
                {
                    "observation": list(seen.invert(own.observation).numpy()),
                    "action": list(own.action.numpy()),
                    "next_observation": list(seen.invert(own.next_observation).numpy()),
                    "task_reward": own.task_reward.numpy(),
                    "task": task,
                    "target": target,
                    "episode": np.arange(steps) // episode_length,
                    "step": np.arange(steps) % episode_length,
                }
            )
        )
    return pd.concat(frames, ignore_index=True)
