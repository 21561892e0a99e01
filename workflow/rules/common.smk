"""The validated settings, the study, and the few functions that tell the rules their inputs and parameters.

What a run or an artefact is made from decides whether it is made again: its identity, noted in its folder. Each rule
leaves a marker with the hash of that identity in its name, asks for the markers of what it reads, and all of them are
`ancient`: neither the time of a file nor Snakemake's own records count.
"""

import gc
import os
import sys
from functools import cache
from pathlib import Path

from snakemake.exceptions import WorkflowError
from snakemake.logging import logger

from mtcsirl.agents import kernels
from mtcsirl.errors import UserError
from mtcsirl.extensions import VARIABLE
from mtcsirl.files.identity import marker
from mtcsirl.names import EXPERIMENTS, KERNELS, TASKS
from mtcsirl.settings.loading import configured, read_yaml
from mtcsirl.settings.machine import check_study
from mtcsirl.settings.template import as_json
from mtcsirl.study.ablations import ABLATIONS
from mtcsirl.study.artefacts import HEAT_MAPS, OTHERS, settle_artefacts
from mtcsirl.study.design import ARTEFACTS, CLAIMS, design
from mtcsirl.study.keys import FIELDS
from mtcsirl.study.plan import plan, request
from mtcsirl.study.rates import load_rates
from mtcsirl.study.runs import Baseline, Demonstrations, Expert, IrlRun, Score, Transfer
from mtcsirl.study.screen import EXPECTED
from mtcsirl.study.standing import over_unfinished, settle
from mtcsirl.study.status import before_it_starts
from mtcsirl.worlds import drawable

gc.set_threshold(100_000)  # a DAG is many objects that all stay: looking for garbage takes a fifth of building it

try:
    if workflow.resource_settings.cores == 0:
        raise UserError("--cores 0: no job could ever start; give at least 1")
    # Snakemake has read these files too, but takes what is ambiguous without a word; those of --configfile win
    given = {Path(file).resolve() for file in workflow.config_settings.configfiles}
    files = sorted(workflow.configfiles if workflow.is_main_process else (), key=lambda f: Path(f).resolve() in given)
    written = [(str(file), read_yaml(file)) for file in files]
    SETTINGS = configured(config, [*written, ("--config", workflow.config_settings.config or {})])
    kernels.asked(os.environ)
    if workflow.is_main_process and workflow.resource_settings.nodes is None:
        check_study(SETTINGS)  # jobs run here and not on the nodes of a cluster
except UserError as error:
    sys.exit(str(error))

STUDY = design(SETTINGS)
RUNS = {run.folder: run for name in (None, *ABLATIONS) for run in design(SETTINGS, name)}
MADE = settle(RUNS.values(), SETTINGS, mark=workflow.is_main_process)
OVER_UNFINISHED = over_unfinished(RUNS.values(), MADE, SETTINGS.results)
MADE_PAGES = settle_artefacts([*ARTEFACTS, *ABLATIONS, *OTHERS], SETTINGS, mark=workflow.is_main_process)
RATES = load_rates()
RESULTS = SETTINGS.results
# plain `snakemake` of a virtual environment that is not activated finds `mtcsirl` beside itself
os.environ["PATH"] = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"

os.environ[VARIABLE] = os.pathsep.join(SETTINGS.extensions)
# whether scenes can be drawn is one answer for the whole workflow
os.environ[drawable.VARIABLE] = drawable.lacking() or ""
os.environ.setdefault(KERNELS, "")


envvars:
    "PATH",
    VARIABLE,
    drawable.VARIABLE,
    KERNELS,


pathvars:
    results=SETTINGS.results,
    figures=SETTINGS.figures,
    logs=f"{SETTINGS.results}/logs",


onstart:
    if workflow.is_main_process:
        watch_slurm()
        logger.info(before_it_starts(STUDY, SETTINGS))
        EXPECTED.update((s.stage, 3600 * s.core_hours / s.jobs) for s in plan(STUDY, SETTINGS, RATES))


wildcard_constraints:
    **FIELDS,
    cs_reward="|".join(SETTINGS.cs_rewards),
    method="|".join({*SETTINGS.methods, "mt_csirl"}),
    experiment="|".join(EXPERIMENTS),
    task="|".join(TASKS),
    source="|".join((*TASKS, "all")),
    identity="[0-9a-f]{16}",


def made(kind):
    """The output of the stage of ``kind``: the marker of a finished run; the files beside it are the run's own."""
    return f"<results>/{kind.PATTERN}/{marker('{identity}')}"


def log_of(kind):
    """The log of a run, one per identity."""
    return f"<logs>/{kind.PATTERN}/{{identity}}.log"


def run_of(kind, wildcards):
    """The run of the study with these wildcards."""
    folder = kind.PATTERN.format(**wildcards)
    if folder not in RUNS:
        raise WorkflowError(f"{folder} is no run of the study at scale {SETTINGS.scale}; add it to the configuration")
    return RUNS[folder]


def settings_of(kind):
    """The settings that a run depends on, as JSON."""
    return lambda wildcards: settings_text(run_of(kind, wildcards))


@cache
def settings_text(run):
    """Asked for several times per job."""
    return as_json(run.settings(SETTINGS))


@cache
def asked(run, attempt):
    """What a run asks a cluster for on its first, second, ... try."""
    return request(run, SETTINGS, RATES, attempt)


def memory_of(kind):
    """The memory of a run as planned, with a margin and more on a retry."""
    return lambda wildcards, attempt: asked(run_of(kind, wildcards), attempt).mem_mb


def minutes_of(kind):
    """The minutes that a run may take, likewise."""
    return lambda wildcards, attempt: asked(run_of(kind, wildcards), attempt).minutes


def markers(runs):
    """The markers of ``runs``."""
    return [ancient(f"{RESULTS}/{run.folder}/{marker(MADE[run.folder])}") for run in runs]


def needed_by(kind):
    """The markers of what a run reads, if it does not stand already over a run that has to be made."""

    def find(wildcards):
        run = run_of(kind, wildcards)
        return [] if run.folder in OVER_UNFINISHED else markers(run.needs.values())

    return find


def folders_of(kind, role):
    """The folders of what a run reads as its ``role``: expert, baseline, reward, demonstrations."""

    def find(wildcards):
        needs = run_of(kind, wildcards).needs
        return [f"{RESULTS}/{run.folder}" for name, run in needs.items() if name.partition(" ")[0] == role]

    return find


def page(name):
    """The marker of an artefact, an output of its rule."""
    return f"<results>/artefacts/{name}/{marker(MADE_PAGES[name])}"


def shown_by(name):
    """The markers of the runs that a table, figure or page shows (None: of the whole study)."""
    return markers(design(SETTINGS, name))
