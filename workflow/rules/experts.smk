"""Agents on known rewards: experts (task and common-sense reward) and the plain SAC baseline."""

EXPERT = "{variant}expert/{cs_reward}/{task}-t{target}/s{seed}"
BASELINE = "sac/{task}-t{target}/s{seed}"


rule train_expert:
    """SAC on the task reward and the weighted ground-truth common-sense reward."""
    input:
        code=code("train_expert"),
    output:
        **outputs("train_expert", EXPERT),
    log:
        f"<logs>/{EXPERT}.log",
    benchmark:
        f"<benchmarks>/{EXPERT}.tsv"
    threads: 1
    resources:
        mem_mb=1200,
    params:
        settings=settings_of(EXPERT),
        folder=subpath(output.gate_json, parent=True),
    shell:
        "mtcsirl train-expert --task {wildcards.task:q} --target {wildcards.target:q} --seed {wildcards.seed:q}"
        " --cs-reward {wildcards.cs_reward:q} --settings {params.settings:q} --output {params.folder:q} > {log:q} 2>&1"


rule train_sac:
    """SAC on the task reward alone."""
    input:
        code=code("train_sac"),
    output:
        **outputs("train_sac", BASELINE),
    log:
        f"<logs>/{BASELINE}.log",
    benchmark:
        f"<benchmarks>/{BASELINE}.tsv"
    threads: 1
    resources:
        mem_mb=1200,
    params:
        settings=settings_of(BASELINE),
        folder=subpath(output.gate_json, parent=True),
    shell:
        "mtcsirl train-sac --task {wildcards.task:q} --target {wildcards.target:q} --seed {wildcards.seed:q}"
        " --settings {params.settings:q} --output {params.folder:q} > {log:q} 2>&1"
