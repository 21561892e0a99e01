"""New agents on learned rewards."""

TRANSFER = "{variant}transfer/{experiment}/{method}/{cs_reward}/{source}/{task}-t{target}/s{seed}"


rule transfer:
    """SAC from scratch on the task reward and a learned reward that stays as it is."""
    input:
        reward=needed_by(TRANSFER, "irl", "reward.json", "reward.safetensors"),
        code=code("transfer"),
    output:
        **outputs("transfer", TRANSFER),
    log:
        f"<logs>/{TRANSFER}.log",
    benchmark:
        f"<benchmarks>/{TRANSFER}.tsv"
    threads: 1
    resources:
        mem_mb=1200,
    params:
        settings=settings_of(TRANSFER),
        task_reward=learned_task_reward,
        reward=folder_of("reward"),
        folder=subpath(output.gate_json, parent=True),
    shell:
        "mtcsirl transfer --reward {params.reward:q} --task {wildcards.task:q} --target {wildcards.target:q}"
        " --cs-reward {wildcards.cs_reward:q} --seed {wildcards.seed:q} --task-reward {params.task_reward:q}"
        " --settings {params.settings:q} --output {params.folder:q} > {log:q} 2>&1"
