"""The verbs that train, learn and measure: one per stage of the DAG, and ``evaluate``."""

import argparse
from functools import partial
from pathlib import Path

from mtcsirl.commands.arguments import (
    Verbs,
    add_agent,
    add_cs_reward,
    add_output,
    add_run_settings,
    add_task,
    add_verb,
    chosen_experiment,
    method,
    path,
    refuse_folder_of_others,
    run_settings,
    seed,
)
from mtcsirl.errors import UserError
from mtcsirl.names import EXPERIMENTS

AGENT_FILES = "policy.safetensors/.json, curve.csv, evaluation.csv, gate.json, settings.json, provenance.json"


def register(verbs: Verbs) -> None:
    """Add the verbs."""
    _train_expert(verbs)
    _train_sac(verbs)
    _collect_demonstrations(verbs)
    _learn_reward(verbs)
    _transfer(verbs)
    _score_reward(verbs)
    _evaluate(verbs)


def _train_expert(verbs: Verbs) -> None:
    def run(parsed: argparse.Namespace) -> None:
        from mtcsirl.settings.runs import AgentRunSettings, expert_run
        from mtcsirl.stages import training as stages

        run = partial(expert_run, task=parsed.task, cs_reward=parsed.cs_reward)
        settings = run_settings(parsed, AgentRunSettings, run, "train_expert")
        job = stages.expert_job(settings, parsed.task, parsed.target, parsed.cs_reward, parsed.seed)
        stages.train(job, parsed.output)

    verb = add_verb(
        verbs,
        "train-expert",
        run,
        does="train SAC on the task reward and a weighted ground-truth common-sense reward",
        needs="nothing",
        writes=f"{AGENT_FILES} into --output",
    )
    add_agent(verb)
    add_run_settings(verb)
    add_output(verb)


def _train_sac(verbs: Verbs) -> None:
    def run(parsed: argparse.Namespace) -> None:
        from mtcsirl.settings.runs import AgentRunSettings, baseline_run
        from mtcsirl.stages import training as stages

        settings = run_settings(parsed, AgentRunSettings, lambda s: baseline_run(s, parsed.task), "train_sac")
        stages.train(stages.sac_job(settings, parsed.task, parsed.target, parsed.seed), parsed.output)

    verb = add_verb(
        verbs,
        "train-sac",
        run,
        does="train the baseline: SAC on the task reward alone",
        needs="nothing",
        writes=f"{AGENT_FILES} into --output",
    )
    add_agent(verb, cs_reward=False)
    add_run_settings(verb)
    add_output(verb)


def _collect_demonstrations(verbs: Verbs) -> None:
    def run(parsed: argparse.Namespace) -> None:
        from mtcsirl.settings.runs import DemonstrationRunSettings, demonstration_run
        from mtcsirl.stages import training as stages

        settings = run_settings(parsed, DemonstrationRunSettings, demonstration_run, "collect_demonstrations")
        stages.collect_demonstrations(
            settings, parsed.expert, parsed.task, parsed.target, parsed.cs_reward, parsed.output
        )

    verb = add_verb(
        verbs,
        "collect-demonstrations",
        run,
        does="record episodes of an expert's stochastic policy with the task reward",
        needs="the folder of a trained expert",
        writes="demonstrations.parquet, gate.json, settings.json, provenance.json into --output",
    )
    verb.add_argument("--expert", required=True, type=_folder, metavar="DIR", help="folder of the expert")
    add_task(verb)
    add_cs_reward(verb)
    add_run_settings(verb)
    add_output(verb)


def _learn_reward(verbs: Verbs) -> None:
    def run(parsed: argparse.Namespace) -> None:
        from mtcsirl.episodes.demonstrations import member_of
        from mtcsirl.settings.runs import IrlRunSettings, irl_run
        from mtcsirl.stages import training as stages

        members = [member_of(file) for file in parsed.demonstrations]
        experiment = chosen_experiment(parsed.experiment, members)
        run = partial(irl_run, experiment=experiment, tasks={task for task, _ in members}, method=parsed.method)
        settings = run_settings(parsed, IrlRunSettings, run, "learn_reward")
        stages.learn_reward(
            settings, parsed.method, parsed.cs_reward, parsed.demonstrations, parsed.seed, parsed.output
        )

    verb = add_verb(
        verbs,
        "learn-reward",
        run,
        does="learn a common-sense reward from demonstrations of one or several tasks and targets",
        needs="demonstrations.parquet of each task and target",
        writes="reward.safetensors/.json, curve.csv, diagnostics.csv, evaluation.csv, gate.json, samples.parquet, "
        "policies/, settings.json, provenance.json into --output",
    )
    verb.add_argument("--method", required=True, type=method, metavar="NAME", help="mt_csirl, mt_airl, ...")
    add_cs_reward(verb)
    verb.add_argument("--seed", required=True, type=seed, help="seed of every random number of the run")
    verb.add_argument("--demonstrations", required=True, nargs="+", type=path, metavar="FILE", help="Parquet files")
    verb.add_argument(
        "--experiment", choices=EXPERIMENTS, help="default: what the tasks and targets of the demonstrations make it"
    )
    add_run_settings(verb)
    add_output(verb)


def _transfer(verbs: Verbs) -> None:
    def run(parsed: argparse.Namespace) -> None:
        from mtcsirl.settings.runs import AgentRunSettings, transfer_run
        from mtcsirl.stages import training as stages

        settings = run_settings(parsed, AgentRunSettings, lambda s: transfer_run(s, parsed.task), "transfer")
        job = stages.transfer_job(
            settings,
            parsed.reward,
            parsed.task,
            parsed.target,
            parsed.cs_reward,
            parsed.seed,
            learned_task_reward=parsed.task_reward == "learned",
        )
        stages.train(job, parsed.output)

    verb = add_verb(
        verbs,
        "transfer",
        run,
        does="train a new agent from scratch on the task reward and a learned reward that stays as it is",
        needs="the folder of a learned reward",
        writes=f"{AGENT_FILES} into --output",
    )
    verb.add_argument("--reward", required=True, type=_folder, metavar="DIR", help="folder of the learned reward")
    verb.add_argument(
        "--task-reward",
        choices=("known", "learned"),
        default="known",
        help="Meta-World's reward, or the one that mt_csirl_lt learned for this task and target (Table 4)",
    )
    add_agent(verb)
    add_run_settings(verb)
    add_output(verb)


def _score_reward(verbs: Verbs) -> None:
    def run(parsed: argparse.Namespace) -> None:
        from mtcsirl.settings.runs import ScoreRunSettings, score_run
        from mtcsirl.stages import training as stages

        settings = run_settings(parsed, ScoreRunSettings, score_run, "score_reward")
        stages.score_reward(
            settings,
            parsed.reward,
            parsed.expert,
            parsed.baseline,
            parsed.task,
            parsed.target,
            parsed.cs_reward,
            parsed.seed,
            parsed.output,
        )

    verb = add_verb(
        verbs,
        "score-reward",
        run,
        does="correlate a learned reward with the ground truth on named transition sets, beside controls",
        needs="the folders of a learned reward, of an expert and of a SAC baseline of the task",
        writes="scores.csv, points.parquet, settings.json, provenance.json into --output",
    )
    for name, what in (("reward", "the learned reward"), ("expert", "an expert"), ("baseline", "a SAC baseline")):
        verb.add_argument(f"--{name}", required=True, type=_folder, metavar="DIR", help=f"folder of {what}")
    add_agent(verb)
    add_run_settings(verb)
    add_output(verb)


def _evaluate(verbs: Verbs) -> None:
    def run(parsed: argparse.Namespace) -> None:
        import pandas as pd

        from mtcsirl.episodes.evaluation import COLUMNS, evaluate
        from mtcsirl.episodes.policy import load_policy
        from mtcsirl.files.storage import write_csv
        from mtcsirl.settings.runs import AgentRunSettings, baseline_run

        refuse_folder_of_others(parsed.output)
        settings = run_settings(parsed, AgentRunSettings, lambda s: baseline_run(s, parsed.task))
        policy = load_policy(parsed.policy)
        rows = evaluate(policy, parsed.task, parsed.target, parsed.cs_reward, parsed.seed, settings)
        frame = pd.DataFrame(rows, columns=list(COLUMNS))
        write_csv(parsed.output / "evaluation.csv", frame)
        print(frame.groupby(["policy", "metric"])["value"].agg(["mean", "std"]).round(3).to_string())

    verb = add_verb(
        verbs,
        "evaluate",
        run,
        does="run a stored policy for stochastic and deterministic episodes and print what it reaches",
        needs="the folder of a trained agent",
        writes="evaluation.csv into --output",
    )
    verb.add_argument("--policy", required=True, type=_folder, metavar="DIR", help="folder of the agent")
    add_agent(verb, cs_reward=False)
    verb.add_argument("--cs-reward", default="", help="name to write into the rows")
    add_run_settings(verb)
    add_output(verb)


def _folder(text: str) -> Path:
    folder = path(text)
    if not folder.is_dir():
        raise UserError(f"{text}: no such folder; run the stage that makes it first")
    return folder
