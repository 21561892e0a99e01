"""The verbs that train, learn and measure: one per stage of the DAG, and ``evaluate``."""

import argparse
from functools import partial
from pathlib import Path

from mtcsirl.commands.arguments import (
    Verbs,
    add_agent,
    add_cs_reward,
    add_device,
    add_identity,
    add_output,
    add_run_settings,
    add_verb,
    add_workers,
    check_experiment,
    cs_reward,
    demonstrations_given,
    method,
    path,
    run_settings,
    seed,
)
from mtcsirl.errors import UserError
from mtcsirl.names import EXPERIMENTS
from mtcsirl.study.folders import check_without_run
from mtcsirl.study.inputs import check_demonstrations, check_evaluation

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
        from mtcsirl.stages.train_expert import train_expert
        from mtcsirl.study.runs import Expert

        of_task = partial(expert_run, task=parsed.task, cs_reward=parsed.cs_reward)
        settings = run_settings(parsed, AgentRunSettings, of_task, "train_expert")
        expert = Expert(parsed.cs_reward, parsed.task, parsed.target, parsed.seed)
        train_expert(settings, expert, parsed.output, wanted=parsed.identity)

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
    add_device(verb)
    add_output(verb)
    add_identity(verb)


def _train_sac(verbs: Verbs) -> None:
    def run(parsed: argparse.Namespace) -> None:
        from mtcsirl.settings.runs import AgentRunSettings, baseline_run
        from mtcsirl.stages.train_sac import train_sac
        from mtcsirl.study.runs import Baseline

        settings = run_settings(parsed, AgentRunSettings, lambda s: baseline_run(s, parsed.task), "train_sac")
        train_sac(settings, Baseline(parsed.task, parsed.target, parsed.seed), parsed.output, wanted=parsed.identity)

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
    add_device(verb)
    add_output(verb)
    add_identity(verb)


def _collect_demonstrations(verbs: Verbs) -> None:
    def run(parsed: argparse.Namespace) -> None:
        from mtcsirl.settings.runs import DemonstrationRunSettings, demonstration_run
        from mtcsirl.stages.collect_demonstrations import collect_demonstrations
        from mtcsirl.study.runs import Demonstrations, Expert

        of_expert = partial(demonstration_run, cs_reward=parsed.cs_reward)
        settings = run_settings(parsed, DemonstrationRunSettings, of_expert, "collect_demonstrations")
        shown = Demonstrations(Expert(parsed.cs_reward, parsed.task, parsed.target, parsed.seed))
        check_evaluation(parsed.expert)
        collect_demonstrations(settings, shown, parsed.expert, parsed.output, wanted=parsed.identity)

    verb = add_verb(
        verbs,
        "collect-demonstrations",
        run,
        does="record episodes of an expert's stochastic policy with the task reward",
        needs="the folder of a trained expert",
        writes="demonstrations.parquet, gate.json, settings.json, provenance.json into --output",
    )
    verb.add_argument("--expert", required=True, type=_folder, metavar="DIR", help="folder of the expert")
    add_agent(verb)
    add_run_settings(verb)
    add_output(verb)
    add_identity(verb)


def _learn_reward(verbs: Verbs) -> None:
    def run(parsed: argparse.Namespace) -> None:
        from mtcsirl.episodes.demonstrations import member_of
        from mtcsirl.settings.runs import IrlRunSettings, irl_run
        from mtcsirl.stages.learn_reward import Learning, experiment_of, learn_reward

        members = []
        for file in parsed.demonstrations:
            with demonstrations_given(file):
                check_demonstrations(file)
                members.append(member_of(file))
        experiment, source = experiment_of(members)
        if (parsed.experiment, experiment) == ("multi_target", "single_target"):
            experiment = "multi_target"  # of one target, as at smoke scale
        check_experiment(parsed.experiment, experiment, members)
        tasks = {task for task, _ in members}
        of_members = partial(irl_run, experiment=experiment, tasks=tasks, method=parsed.method)
        settings = run_settings(parsed, IrlRunSettings, of_members, "learn_reward")
        learning = Learning(experiment, parsed.method, parsed.cs_reward, source, parsed.seed)
        shown = parsed.demonstrations
        learn_reward(settings, learning, shown, parsed.output, wanted=parsed.identity, workers=parsed.workers)

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
    add_workers(verb)
    add_run_settings(verb)
    add_device(verb)
    add_output(verb)
    add_identity(verb)


def _transfer(verbs: Verbs) -> None:
    def run(parsed: argparse.Namespace) -> None:
        from mtcsirl.settings.runs import AgentRunSettings, transfer_run
        from mtcsirl.stages.transfer import NewAgent, transfer

        settings = run_settings(parsed, AgentRunSettings, lambda s: transfer_run(s, parsed.task), "transfer")
        agent = NewAgent(parsed.cs_reward, parsed.task, parsed.target, parsed.seed, parsed.task_reward)
        transfer(settings, parsed.reward, agent, parsed.output, wanted=parsed.identity)

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
    add_device(verb)
    add_output(verb)
    add_identity(verb)


def _score_reward(verbs: Verbs) -> None:
    def run(parsed: argparse.Namespace) -> None:
        from mtcsirl.settings.runs import ScoreRunSettings, score_run
        from mtcsirl.stages.score_reward import Scoring, score_reward

        settings = run_settings(parsed, ScoreRunSettings, score_run, "score_reward")
        scoring = Scoring(parsed.cs_reward, parsed.task, parsed.target, parsed.seed)
        policies = parsed.expert, parsed.baseline
        for folder in (*parsed.expert, *parsed.baseline):
            check_evaluation(folder)
        score_reward(settings, scoring, parsed.reward, *policies, parsed.output, wanted=parsed.identity)

    verb = add_verb(
        verbs,
        "score-reward",
        run,
        does="correlate a learned reward with the ground truth on named transition sets, beside controls",
        needs="the folders of a learned reward, of experts and of SAC baselines of the task",
        writes="scores.csv, points.parquet, settings.json, provenance.json into --output",
    )
    verb.add_argument("--reward", required=True, type=_folder, metavar="DIR", help="folder of the learned reward")
    for name, what in (("expert", "experts"), ("baseline", "SAC baselines")):
        does = f"folders of the {what} of the task, one per seed"
        verb.add_argument(f"--{name}", required=True, nargs="+", type=_folder, metavar="DIR", help=does)
    add_agent(verb)
    add_run_settings(verb)
    add_output(verb)
    add_identity(verb)


def _evaluate(verbs: Verbs) -> None:
    def run(parsed: argparse.Namespace) -> None:
        import pandas as pd

        from mtcsirl.episodes.evaluation import COLUMNS, evaluate
        from mtcsirl.episodes.policy import load_policy
        from mtcsirl.files.storage import write_csv
        from mtcsirl.settings.loading import override
        from mtcsirl.settings.runs import AgentRunSettings, baseline_run
        from mtcsirl.settings.unread import EVALUATE, refuse_others

        check_without_run(parsed.output)
        settings = run_settings(parsed, AgentRunSettings, lambda s: baseline_run(s, parsed.task))
        refuse_others(override({}, parsed.set), EVALUATE, "evaluate")
        policy = load_policy(parsed.policy)
        rows = evaluate(policy, parsed.task, parsed.target, parsed.cs_reward or "", parsed.seed, settings)
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
    does = "what its rows say that the agent was trained on; default: no common-sense reward"
    verb.add_argument("--cs-reward", type=cs_reward, metavar="NAME", help=does)
    add_run_settings(verb)
    add_output(verb)


def _folder(text: str) -> Path:
    folder = path(text)
    if not folder.is_dir():
        raise UserError(f"{text}: no such folder; run the stage that makes it first")
    return folder
