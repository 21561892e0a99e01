"""Stage ``score_reward``: a learned reward against the truth on named transition sets."""

from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

from mtcsirl.files.identity import read_record
from mtcsirl.results.scoring import score
from mtcsirl.rewards.learned import DESCRIPTION, WEIGHTS
from mtcsirl.settings.runs import ScoreRunSettings
from mtcsirl.stages.running import Input, Task, look_at, running
from mtcsirl.study.keys import identity

STAGE = "score_reward"
POLICY = ("policy.json", "policy.safetensors")


class Scoring(NamedTuple):
    """Where a reward is scored."""

    cs_reward: str
    task: str
    target: int
    seed: int


def score_reward(
    settings: ScoreRunSettings,
    scoring: Scoring,
    reward: Path,
    experts: Sequence[Path],
    baselines: Sequence[Path],
    output: Path,
    *,
    wanted: str | None = None,
) -> None:
    """Score the reward in the folder ``reward`` on transitions of these policies into the folder ``output``."""
    inputs = {"reward": look_at(reward, (WEIGHTS, DESCRIPTION, "samples.parquet"))}
    inputs |= _policies("expert", experts) | _policies("baseline", baselines)
    made_from = identity(STAGE, scoring._asdict(), settings, {role: one.hash for role, one in inputs.items()})
    read = {role: one.bytes for role, one in inputs.items()}
    files = {"reward": reward / WEIGHTS, "samples": reward / "samples.parquet"}
    for role, folders in (("expert", experts), ("baseline", baselines)):
        files |= {f"{role}_{index}": folder / "policy.safetensors" for index, folder in enumerate(folders)}
    with running(Task(made_from, settings, output, read, files, wanted)) as stopwatch:
        if stopwatch is not None:
            score(settings, reward, experts, baselines, *scoring, output)


def _policies(role: str, folders: Sequence[Path]) -> dict[str, Input]:
    """Policies by the seed that their record names, else by their place."""
    found = {}
    for index, folder in enumerate(folders):
        record = read_record(folder)
        seed = index if record is None else record.identity.key.get("seed", index)
        found[f"{role} s{seed}"] = look_at(folder, POLICY)
    return found
