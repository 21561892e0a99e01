"""Do the agents on which every claim stands learn? SAC baselines and experts of the desk scale, on development seeds.

    python -m benchmarks.gates                                         every task, seeds 100 to 102
    python -m benchmarks.gates --agents sac --tasks reach push-back    some of them
    python -m benchmarks.gates --print                                 the table of what is there

Agents have the settings of the DAG's jobs (stages ``train_sac`` and ``train_expert``) and train in lockstep, as with
``mtcsirl train-together``: folders below ``--output`` are those of the DAG, and what is there is not trained again.
"""

import argparse
import os
from collections.abc import Iterable, Iterator, Sequence
from itertools import product
from pathlib import Path

os.environ.setdefault("OMP_NUM_THREADS", "1")

import pandas as pd
import torch

from mtcsirl.errors import UserError
from mtcsirl.files.storage import read_json, write_csv
from mtcsirl.names import DESIGN_TASKS
from mtcsirl.settings.loading import load
from mtcsirl.stages.together import train_together
from mtcsirl.study.runs import Baseline, Expert

SAC = "sac"
COLUMNS = ("agent", "task", "target", "seed", "steps", "success", "velocity", "action_norm", "task_reward", "passed")


def runs(
    agents: Sequence[str], tasks: Sequence[str], targets: Sequence[int], seeds: Sequence[int]
) -> Iterator[Baseline | Expert]:
    """Every combination as a run of the design; an agent is ``sac`` or the cs-reward of an expert."""
    for agent, task, target, seed in product(agents, tasks, targets, seeds):
        yield Baseline(task, target, seed) if agent == SAC else Expert(agent, task, target, seed)


def table(wanted: Iterable[Baseline | Expert], output: Path) -> pd.DataFrame:
    """One row per trained agent: means over its stochastic episodes and whether it passed its gate."""
    rows = []
    for run in wanted:
        folder = output / run.folder
        if not (folder / "settings.json").is_file():
            continue
        episodes = pd.read_csv(folder / "evaluation.csv").query("policy == 'stochastic'")
        means = episodes.groupby("metric")["value"].mean()
        rows.append(
            {
                "agent": getattr(run, "cs_reward", SAC),
                "task": run.task,
                "target": run.target,
                "seed": run.seed,
                "steps": read_json(folder / "settings.json")["steps"],
                **{name: means[name] for name in ("success", "velocity", "action_norm", "task_reward")},
                "passed": read_json(folder / "gate.json")["passed"],
            }
        )
    return pd.DataFrame(rows, columns=list(COLUMNS))


def main() -> None:
    """Train, print the table and write it."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--agents", nargs="+", default=[SAC, "velocity", "action_norm"])
    parser.add_argument("--tasks", nargs="+", default=list(DESIGN_TASKS))
    parser.add_argument("--targets", nargs="+", type=int, default=[0])
    parser.add_argument("--seeds", nargs="+", type=int, default=[100, 101, 102])
    parser.add_argument("--config", nargs="*", type=Path, default=[], help="overlays on the desk scale")
    parser.add_argument("--output", type=Path, default=Path("results/development"))
    parser.add_argument("--print", action="store_true", help="only the table")
    arguments = parser.parse_args()
    torch.set_num_threads(1)
    wanted = list(runs(arguments.agents, arguments.tasks, arguments.targets, arguments.seeds))
    try:
        if not arguments.print:
            train_together(wanted, load(arguments.config), arguments.output)
    except UserError as error:
        raise SystemExit(str(error)) from error
    found = table(wanted, arguments.output)
    write_csv(arguments.output / "gates.csv", found)
    print(found.round(3).to_string(index=False))
    print(found.groupby(["agent", "task"])["passed"].agg(["sum", "count"]).to_string())


if __name__ == "__main__":
    main()
