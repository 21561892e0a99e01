"""What the score of a learned reward takes on this machine: the stage itself, on agents that never learned.

The whole stage in a process of its own, as a job runs it: what a process did before decides how much memory the system
takes back and clears again after every array, and the same functions called elsewhere took up to twice as long.
"""

import subprocess
import sys
import tempfile
from pathlib import Path

import torch

from mtcsirl.calibration import loops
from mtcsirl.episodes.policy import save_policy
from mtcsirl.files.storage import read_csv
from mtcsirl.irl.run import _write as write_irl_run
from mtcsirl.names import SINGLE_TASKS
from mtcsirl.results import correlation, scoring
from mtcsirl.settings import SacSettings, Settings
from mtcsirl.settings.runs import ScoreRunSettings, irl_run

TASK, TARGET, SEED = SINGLE_TASKS[0], 0, 0
METHOD = "mt_csirl"
POLICIES = 5
"""Experts, and baselines: the seeds of the desk scale."""
JOB = "import sys, pandas, pyarrow.parquet; from mtcsirl.calibration.scores import job; job(*sys.argv[1:])"


def score_seconds() -> dict[str, float]:
    """A transition set scored: without resamples (``scored``), and per transition and resample (``resampled``)."""
    with tempfile.TemporaryDirectory() as folder:
        _write_runs(Path(folder))
        command = [sys.executable, "-c", JOB, folder]
        said = subprocess.run(command, check=True, stdout=subprocess.PIPE, text=True).stdout
        counts = read_csv(Path(folder) / "scores.csv").query("reward == 'learned' and statistic == 'pearson'")["n"]
    rest, resampling = map(float, said.split())
    resamples = ScoreRunSettings().score.bootstrap * float(counts.sum())
    return {"scored": rest / len(counts), "resampled": resampling / resamples}


def job(name: str) -> None:
    """Score what lies in a folder, and print the seconds that resamples took and those of all but them and acting."""
    torch.set_num_threads(1)
    folder = Path(name)
    agents = [folder / f"agent{index}" for index in range(POLICIES)]
    key = (loops.CS_REWARD, TASK, TARGET, SEED)
    spent = loops.watch(correlation, "cluster_bootstrap", part="resamples")
    loops.watch(scoring, "collect_demonstrations", part="acting", spent=spent)
    whole = loops.seconds(lambda: scoring.score(ScoreRunSettings(), folder / "irl", agents, agents, *key, folder))
    print(whole - sum(spent.values()), spent["resamples"])


def _write_runs(folder: Path) -> None:
    """An IRL run of one generator, and the policy of a lone agent some times over."""
    training = loops.agents([(TASK, TARGET)], SacSettings(), 1)
    for index in range(POLICIES):
        save_policy(training.policy(0), folder / f"agent{index}")
    training.close()
    own = irl_run(Settings(), "single_target", (TASK,))
    trainer = loops.generators([(TASK, TARGET)], METHOD, own, policies=1)
    write_irl_run(trainer, folder / "irl", loops.CS_REWARD, SEED, {"experiment": "single_target", "source": TASK})
    trainer.world.environments.close()
