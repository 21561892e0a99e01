"""The validated settings, the study, and the few functions that tell the rules their inputs and parameters."""

import os
import sys
from pathlib import Path

from snakemake.exceptions import WorkflowError

from mtcsirl.study.ablations import ABLATIONS
from mtcsirl.study.design import ARTEFACTS, design
from mtcsirl.errors import UserError
from mtcsirl.extensions import VARIABLE
from mtcsirl.study.outputs import OUTPUTS
from mtcsirl.settings.loading import configured, read_yaml
from mtcsirl.settings.machine import check_study
from mtcsirl.settings.template import as_json
from mtcsirl.study.sources import sources
from mtcsirl.names import TASKS

try:
    for file in workflow.configfiles if workflow.is_main_process else ():
        read_yaml(file)  # Snakemake has read them too, but takes what is ambiguous without a word
    SETTINGS = configured(config)
    if workflow.is_main_process and workflow.resource_settings.nodes is None:
        check_study(SETTINGS)  # jobs run here and not on the nodes of a cluster
except UserError as error:
    sys.exit(str(error))

STUDY = design(SETTINGS)
RUNS = {run.folder: run for name in (None, *ABLATIONS) for run in design(SETTINGS, name)}
RESULTS = SETTINGS.results
PACKAGE = Path(os.path.relpath(Path(workflow.basedir) / "src/mtcsirl"))
# plain `snakemake` of a virtual environment that is not activated finds `mtcsirl` beside itself
os.environ["PATH"] = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"

os.environ[VARIABLE] = os.pathsep.join(SETTINGS.extensions)


envvars:
    "PATH",
    VARIABLE,


pathvars:
    results=SETTINGS.results,
    figures=SETTINGS.figures,
    logs=f"{SETTINGS.results}/logs",
    benchmarks=f"{SETTINGS.results}/benchmarks",


wildcard_constraints:
    variant=r"(ablations/\w+/\w+/)?",
    cs_reward="|".join(SETTINGS.cs_rewards),
    method="|".join({*SETTINGS.methods, "mt_csirl"}),
    experiment="single_target|multi_target|multi_task",
    task="|".join(TASKS),
    source="|".join((*TASKS, "all")),
    target=r"\d+",
    seed=r"\d+",


def outputs(stage, folder):
    """The declared outputs of a run, each file under its name without ending (.csv, else policy.json: policy_json)."""
    return {name.removesuffix(".csv").replace(".", "_"): f"<results>/{folder}/{name}" for name in OUTPUTS[stage]}


def run_of(folder, wildcards):
    """The run of the study in ``folder``, a pattern of wildcards below the results folder."""
    folder = folder.format(**wildcards)
    if folder not in RUNS:
        raise WorkflowError(f"{folder} is no run of the study at scale {SETTINGS.scale}; add it to the configuration")
    return RUNS[folder]


def settings_of(folder):
    """The settings that the run in ``folder`` depends on, as JSON: a change of any other key leaves the run alone."""
    return lambda wildcards: as_json(run_of(folder, wildcards).settings(SETTINGS))


def files(run, *names):
    """The files ``names`` of ``run``."""
    return [f"{RESULTS}/{run.folder}/{name}" for name in names]


def needed_by(folder, role, *names):
    """The files ``names`` of the run that the run in ``folder`` reads as its ``role``: expert, baseline or irl."""
    return lambda wildcards: files(getattr(run_of(folder, wildcards), role), *names)


def folder_of(name):
    """The folder that the input files ``name`` are in, which is what the command line asks for."""
    return lambda wildcards, input: str(Path(getattr(input, name)[0]).parent)


def demonstrations_of(folder):
    """The demonstrations that an IRL run reads: one file per (task, target) that it trains on."""

    def find(wildcards):
        run = run_of(folder, wildcards)
        return [
            f"{RESULTS}/demonstrations/{run.cs_reward}/{task}-t{target}/demonstrations.parquet"
            for task, target in run.members
        ]

    return find


def rows_of(artefact):
    """What the table or figure ``artefact`` (None: the whole study) reads: rows and gate marks of its runs."""
    study = design(SETTINGS, artefact)
    agents = (*study.experts, *study.baselines, *study.irl_runs, *study.transfers)
    rows = [path for run in agents for path in files(run, "evaluation.csv", "curve.csv", "gate.json")]
    rows += [path for run in study.demonstrations for path in files(run, "gate.json")]
    return rows + [path for run in study.scores for path in files(run, "scores.csv", "points.parquet")]


def learned_task_reward(wildcards):
    """Whether a transfer agent earns the known task reward or, as in Table 4, the learned one."""
    return "learned" if run_of(TRANSFER, wildcards).learned_task_reward else "known"


def code(*roots):
    """The modules that ``roots`` (stages or files) consist of, and extensions; listed as input, an edit reruns the rule."""
    return [*(str(PACKAGE / path) for path in sources(*roots)), *SETTINGS.extensions]


def method_file(method):
    """The file of a method of the package, listed as a root of its runs; one of an extension is listed anyway."""
    file = f"irl/methods/{method}.py"
    return [file] if (PACKAGE / file).is_file() else []
