"""Do the agents on which every claim stands learn? SAC baselines and experts of the desk scale, on development seeds.

    python -m benchmarks.gates                                         every task, seeds 100 to 102
    python -m benchmarks.gates --agents sac --tasks reach push-back    some of them
    python -m benchmarks.gates --print                                 the table of what is there

Agents have the settings of the DAG's jobs (stages ``train_sac`` and ``train_expert``) and train in lockstep, those of
one kind and budget in one process, at about two thirds of the cost of one job each. An agent's noise comes from a
stream that it shares with the others, so its numbers are another draw of what the DAG's job with its seed gets. Folders
below ``--output`` are those of the DAG; what is there is not trained again, and a run that was stopped goes on.
"""

import argparse
import os
from collections.abc import Iterable, Iterator, Sequence
from itertools import groupby, product
from pathlib import Path

os.environ.setdefault("OMP_NUM_THREADS", "1")

import pandas as pd
import torch

from mtcsirl.agents.jobs import AgentJob
from mtcsirl.agents.training import train_agents
from mtcsirl.errors import UserError
from mtcsirl.settings import Settings
from mtcsirl.settings.loading import load
from mtcsirl.settings.runs import AgentRunSettings, baseline_run, expert_run
from mtcsirl.settings.study import DESIGN_TASKS
from mtcsirl.stages import expert_job
from mtcsirl.storage import read_json, write_csv, write_json
from mtcsirl.study import Baseline, Expert

SAC = "sac"
COLUMNS = ("agent", "task", "target", "seed", "steps", "success", "velocity", "action_norm", "task_reward", "passed")


def runs(
    agents: Sequence[str], tasks: Sequence[str], targets: Sequence[int], seeds: Sequence[int]
) -> Iterator[Baseline | Expert]:
    """Every combination as a run of the design; an agent is ``sac`` or the cs-reward of an expert."""
    for agent, task, target, seed in product(agents, tasks, targets, seeds):
        yield Baseline(task, target, seed) if agent == SAC else Expert(agent, task, target, seed)


def job(run: Baseline | Expert, settings: Settings) -> AgentJob:
    """The training job of a run, as the stage of the DAG makes it."""
    if isinstance(run, Baseline):
        return AgentJob(run.task, run.target, run.seed, baseline_run(settings, run.task))
    own = expert_run(settings, run.task, run.cs_reward)
    return expert_job(own, run.task, run.target, run.cs_reward, run.seed)


def train(wanted: Iterable[Baseline | Expert], settings: Settings, output: Path) -> None:
    """Train the agents that are not in ``output`` yet, those of one stage and budget together."""

    def together(run: Baseline | Expert) -> tuple[str, int]:
        own: AgentRunSettings = run.settings(settings)  # type: ignore[assignment]
        return run.stage, own.steps

    missing = [run for run in wanted if not (output / run.folder / "settings.json").is_file()]
    for (stage, steps), group in groupby(sorted(missing, key=together), key=together):
        batch = list(group)
        print(f"{stage}: {len(batch)} agents, {steps} steps", flush=True)
        # named after its first run, so that processes that train other agents beside it keep out of its way
        checkpoint = output / f"{batch[0].folder.replace('/', '-')}.safetensors"
        trained = train_agents([job(run, settings) for run in batch], checkpoint=checkpoint)
        for run, agent in zip(batch, trained, strict=True):
            agent.save(output / run.folder)
            write_json(output / run.folder / "settings.json", agent.job.settings.model_dump(mode="json"))


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
            train(wanted, load(arguments.config), arguments.output)
    except UserError as error:
        raise SystemExit(str(error)) from error
    found = table(wanted, arguments.output)
    write_csv(arguments.output / "gates.csv", found)
    print(found.round(3).to_string(index=False))
    print(found.groupby(["agent", "task"])["passed"].agg(["sum", "count"]).to_string())


if __name__ == "__main__":
    main()
