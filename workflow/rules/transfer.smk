"""New agents on learned rewards."""


rule transfer:
    """SAC from scratch on the task reward and a learned reward that stays as it is."""
    input:
        needed_by(Transfer),
    output:
        made(Transfer),
    log:
        log_of(Transfer),
    threads: 1
    resources:
        mem_mb=memory_of(Transfer),
        runtime=minutes_of(Transfer),
    params:
        settings=settings_of(Transfer),
        task_reward=lambda wildcards: run_of(Transfer, wildcards).task_reward,
        reward=folders_of(Transfer, "reward"),
        folder=subpath(output[0], parent=True),
    shell:
        "mtcsirl transfer --reward {params.reward:q} --task {wildcards.task:q} --target {wildcards.target:q}"
        " --cs-reward {wildcards.cs_reward:q} --seed {wildcards.seed:q} --task-reward {params.task_reward:q}"
        " --settings {params.settings:q} --output {params.folder:q} --identity {wildcards.identity:q} >> {log:q} 2>&1"
