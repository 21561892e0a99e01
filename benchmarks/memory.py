"""How much memory a job holds at most, beside what the plan says: `mtcsirl plan` and the workflow's `mem_mb`.

    python -m benchmarks.memory                 every case, each in processes of its own: about five minutes
    python -m benchmarks.memory desk-irl-6      some of them

A case is a run of the desk or the paper scale, shortened: its memories (replay, tabulated densities, rows of curve and
diagnostics) are filled as if it was about to end, then it trains one iteration or episode, writes its checkpoint and
its results. Environments of an IRL run are there but do not move. Printed are the MiB that the process held at most up
to the end of each part, then the plan's, and its ratio to what was measured. `resumed` is a process of its own that
takes the checkpoint up, `scored` one that scores the reward of an IRL run.
"""

import argparse
import dataclasses
import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

os.environ.setdefault("OMP_NUM_THREADS", "1")

import numpy as np
import torch

from mtcsirl.agents import resume
from mtcsirl.agents.jobs import AgentJob
from mtcsirl.agents.replay import Replay
from mtcsirl.agents.sac import FusedSac
from mtcsirl.agents.training import Training
from mtcsirl.episodes.demonstrations import COLUMNS, VECTORS
from mtcsirl.episodes.lockstep import Outcome
from mtcsirl.episodes.policy import save_policy
from mtcsirl.files.checkpoint import load_checkpoint, save_checkpoint
from mtcsirl.irl import run as irl_run
from mtcsirl.irl.resume import load_state, state
from mtcsirl.settings.loading import load
from mtcsirl.settings.runs import AgentRunSettings, IrlRunSettings, ScoreRunSettings, baseline_run
from mtcsirl.settings.runs import irl_run as irl_settings
from mtcsirl.study.memory import agent_memory, irl_memory, score_memory

AGAIN = ("resumed", "scored")
"""Parts that are processes of their own, after the others."""
PARTS = ("start", "training", "checkpoint", "results", *AGAIN)
TASKS = ("reach-wall", "push-back", "window-open", "drawer-close", "coffee-button", "plate-slide")
CASES = (
    *(f"desk-irl-{generators}" for generators in (1, 3, 6, 30)),
    *(f"paper-irl-{generators}" for generators in (1, 5, 30)),
    *(f"{scale}-agents-{agents}" for scale in ("desk", "paper") for agents in (1, 16)),
)
"""Scale, what, and how many of them at once."""
RUN = "memory"
CHECKPOINT = "checkpoint.safetensors"


def peak() -> float:
    """MiB that this process has held at most; what the kernel tells a parent would begin with the parent's."""
    lines = Path("/proc/self/status").read_text().splitlines()
    return float(next(line.split()[1] for line in lines if line.startswith("VmHWM"))) / 1024


def irl(settings: IrlRunSettings, generators: int, folder: Path, again: str) -> Iterator[str]:
    """One IRL run; yields the name of each part when it ends."""
    if again == "scored":
        _score(settings, folder)
        yield again
        return
    rounds = settings.irl.warm_up_iterations + settings.irl.iterations
    few = settings.irl.model_copy(update={"generator_updates": 3})
    evaluation = settings.evaluation.model_copy(update={"episodes": 1})
    settings = settings.model_copy(update={"irl": few, "evaluation": evaluation})
    files = [folder / f"{task}-t{target}.parquet" for task, target in members(generators)]
    trainer = irl_run.make_trainer("mt_csirl", "velocity", files, 0, settings)
    trainer.world = dataclasses.replace(trainer.world, environments=_Idle(trainer.world.environments))
    yield "start"
    if again:
        saved = load_checkpoint(folder / CHECKPOINT, run=RUN)
        assert saved is not None
        load_state(trainer, saved[0])
        trainer.curve, trainer.diagnostics = saved[1]["curve"], saved[1]["diagnostics"]
        trainer.iterate()
        yield again
        return
    trainer.start_at(trainer.irl.warm_up_iterations)
    _fill(trainer.replay)
    for _ in range(trainer.densities._policies - 1):
        trainer._tabulate(False)
    trainer.iterate()
    trainer.curve = [dict(row) for row in trainer.curve * (rounds - 1)]
    trainer.diagnostics = [dict(row) for row in trainer.diagnostics * (rounds - 1)]
    yield "training"
    rows = {"curve": trainer.curve, "diagnostics": trainer.diagnostics}
    save_checkpoint(folder / CHECKPOINT, state(trainer), rows, run=RUN)
    yield "checkpoint"
    irl_run._write(trainer, folder / "results", "velocity", 0, {})
    yield "results"


def agents(settings: AgentRunSettings, count: int, folder: Path, again: str) -> Iterator[str]:
    """So many agents in lockstep; yields the name of each part when it ends."""
    if again == "scored":
        return
    evaluation = settings.evaluation.model_copy(update={"episodes": 1})
    settings = settings.model_copy(update={"evaluation": evaluation})
    jobs = [AgentJob("reach-wall", 0, seed, settings) for seed in range(count)]
    files = [folder / f"{seed}.safetensors" for seed in range(count)]
    training = Training(jobs, checkpoints=files, log=lambda line: None)
    yield "start"
    if again:
        saved = [resume.load(job, file) for job, file in zip(jobs, files, strict=True)]
        resume.restore(training, saved, lambda line: None)
        yield again
        return
    _fill(training.replay)
    training.step = settings.steps - settings.evaluation.episode_steps
    training.learner.updates = int((training.step - settings.sac.random_steps) * settings.sac.updates_per_step)
    training.episode()
    training._try_policies()
    training.curves = [curve * (settings.steps // settings.evaluation.episode_steps) for curve in training.curves]
    yield "training"
    resume.save(training)
    yield "checkpoint"
    for trained, file in zip(training.finish(), files, strict=True):
        trained.save(file.with_suffix(""))
    yield "results"


def _score(settings: IrlRunSettings, folder: Path) -> None:
    """Score the reward that an IRL run left, on policies that were never trained."""
    from mtcsirl.results.scoring import score  # the other jobs do not import what this one needs

    policy = FusedSac(1, settings.sac, seeds=[0]).policy(0)
    policy = dataclasses.replace(policy, observation=settings.environment.observation)
    for name in ("expert", "baseline"):
        save_policy(policy, folder / name)
    own = ScoreRunSettings(environment=settings.environment, discount=settings.sac.discount)
    agents = [folder / "expert"], [folder / "baseline"]
    score(own, folder / "results", *agents, "velocity", "reach-wall", 0, 0, folder / "results")


def members(generators: int) -> list[tuple[str, int]]:
    """Targets of one task, or of six: as the experiments have it."""
    tasks = TASKS if generators % len(TASKS) == 0 else TASKS[:1]
    return [(task, target) for task in tasks for target in range(1, 1 + generators // len(tasks))]


def settings_of(case: str) -> tuple[AgentRunSettings | IrlRunSettings, int]:
    """What a case is a run of, and how many of it."""
    scale, kind, number = case.split("-")
    study, count = load(scale=scale), int(number)
    if kind == "agents":
        return baseline_run(study, "reach-wall"), count
    tasks = {task for task, _ in members(count)}
    experiment = "multi_task" if len(tasks) > 1 else "multi_target" if count > 1 else "single_target"
    return irl_settings(study, experiment, tasks, "mt_csirl"), count


def _fill(replay: Replay) -> None:
    """Random numbers in every row, as if many steps had been added."""
    replay._rows.normal_().clamp_(-0.9, 0.9)
    replay._added = replay.size = replay.capacity


class _Idle:
    """Environments that are there and answer with random numbers at once."""

    def __init__(self, environments: Any) -> None:
        self._held, self._random = environments, np.random.default_rng(0)
        self._count = len(environments.environments)

    def reset(self) -> np.ndarray:
        return self._random.standard_normal((self._count, 39), dtype=np.float32)

    def step(self, action: np.ndarray) -> Outcome:
        nothing = np.zeros(self._count, dtype=bool)
        return Outcome(self.reset(), np.zeros(self._count, dtype=np.float32), nothing, nothing)

    def close(self) -> None:
        self._held.close()


def _demonstrate(settings: IrlRunSettings, generators: int, folder: Path) -> None:
    """Files of random demonstrations, as long as those of the scale."""
    import pandas as pd

    from mtcsirl.files.storage import write_parquet

    random, episodes, length = np.random.default_rng(0), settings.demonstration_episodes, 500
    count = episodes * length
    columns = {name: list(random.uniform(-0.9, 0.9, (count, size)).astype("f4")) for name, size in VECTORS.items()}
    frame = pd.DataFrame(columns).assign(task_reward=1.0, success=True, cs_reward="velocity")
    frame = frame.assign(episode=np.arange(count) // length, step=np.arange(count) % length)
    for task, target in members(generators):
        write_parquet(folder / f"{task}-t{target}.parquet", frame.assign(task=task, target=target)[list(COLUMNS)])


def _alone(case: str, folder: Path, again: str) -> None:
    """Do a case in this process and print the peak after each part."""
    torch.set_num_threads(1)
    settings, count = settings_of(case)
    work = irl if isinstance(settings, IrlRunSettings) else agents
    print(json.dumps({part: peak() for part in work(settings, count, folder, again)}))


def measured(case: str) -> dict[str, float]:
    """MiB by part."""
    settings, count = settings_of(case)
    with tempfile.TemporaryDirectory() as folder:
        if isinstance(settings, IrlRunSettings):
            _demonstrate(settings, count, Path(folder))
        found: dict[str, float] = {}
        for again in ("", *AGAIN):
            command = [sys.executable, "-m", "benchmarks.memory", case, "--folder", folder, "--again", again]
            done = subprocess.run(command, check=True, stdout=subprocess.PIPE, text=True)
            found = json.loads(done.stdout.splitlines()[-1]) | found
    return found


def main() -> None:
    """Print a row per case."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("cases", nargs="*", choices=[*CASES, []], default=CASES, metavar="CASE", help=", ".join(CASES))
    parser.add_argument("--folder", type=Path, help=argparse.SUPPRESS)
    parser.add_argument("--again", default="", help=argparse.SUPPRESS)
    parsed = parser.parse_args()
    if parsed.folder:
        _alone(parsed.cases[0], parsed.folder, parsed.again)
        return
    print("case".ljust(16), *(part.rjust(10) for part in (*PARTS, "plan", "ratio", "score", "ratio")))
    for case in parsed.cases:
        found = measured(case)
        cells = [f"{found[part]:.0f}" if part in found else "" for part in PARTS]
        for part, there in planned(case).items():
            most = found[part] if part == "scored" else max(found[name] for name in PARTS[:-1])
            cells += [f"{there:.0f}", f"{there / most:.2f}"]
        print(case.ljust(16), *(cell.rjust(10) for cell in cells), flush=True)


def planned(case: str) -> dict[str, float]:
    """MiB of a run, and of a score of what it leaves, as planned."""
    settings, count = settings_of(case)
    if isinstance(settings, AgentRunSettings):
        return {"run": agent_memory(settings, count)}
    return {"run": irl_memory(settings, count), "scored": score_memory(settings, count)}


if __name__ == "__main__":
    main()
