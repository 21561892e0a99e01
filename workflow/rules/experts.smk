"""Agents on known rewards: experts (task and common-sense reward) and the plain SAC baseline."""


rule train_expert:
    """SAC on the task reward and the weighted ground-truth common-sense reward."""
    output:
        made(Expert),
    log:
        log_of(Expert),
    threads: 1
    resources:
        mem_mb=memory_of(Expert),
        runtime=minutes_of(Expert),
    params:
        settings=settings_of(Expert),
        folder=subpath(output[0], parent=True),
    shell:
        "mtcsirl train-expert --task {wildcards.task:q} --target {wildcards.target:q} --seed {wildcards.seed:q}"
        " --cs-reward {wildcards.cs_reward:q} --settings {params.settings:q} --output {params.folder:q}"
        " --identity {wildcards.identity:q} >> {log:q} 2>&1"


rule train_sac:
    """SAC on the task reward alone."""
    output:
        made(Baseline),
    log:
        log_of(Baseline),
    threads: 1
    resources:
        mem_mb=memory_of(Baseline),
        runtime=minutes_of(Baseline),
    params:
        settings=settings_of(Baseline),
        folder=subpath(output[0], parent=True),
    shell:
        "mtcsirl train-sac --task {wildcards.task:q} --target {wildcards.target:q} --seed {wildcards.seed:q}"
        " --settings {params.settings:q} --output {params.folder:q} --identity {wildcards.identity:q} >> {log:q} 2>&1"
