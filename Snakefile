"""The replication as one DAG. Every table and figure is a target of its own: snakemake --cores 2 figure_3

`snakemake --lint` asks for a conda environment or container per rule; there is none on purpose: one environment, pinned
in constraints.txt, serves all rules.
"""

from snakemake.utils import min_version

min_version("9.0")


report: "workflow/report/workflow.rst"


configfile: f"{workflow.basedir}/config/config.yaml"


include: "workflow/rules/common.smk"
include: "workflow/rules/slurm.smk"
include: "workflow/rules/experts.smk"
include: "workflow/rules/demonstrations.smk"
include: "workflow/rules/irl.smk"
include: "workflow/rules/diagnostics.smk"
include: "workflow/rules/transfer.smk"
include: "workflow/rules/tables.smk"
include: "workflow/rules/figures.smk"
include: "workflow/rules/report.smk"
include: "workflow/rules/validation.smk"
include: "workflow/rules/ablations.smk"


rule all:
    default_target: True
    input:
        rules.report.input,
        rules.report.output,
        markers(STUDY),  # a run that lost a file is made again, though every page that shows it stands
