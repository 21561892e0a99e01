"""Demonstrations: episodes of the stochastic expert of the study's first seed."""

DEMONSTRATIONS = "demonstrations/{cs_reward}/{task}-t{target}"


rule collect_demonstrations:
    """Episodes of the expert with the task reward, as Parquet."""
    input:
        expert=needed_by(DEMONSTRATIONS, "expert", "policy.json", "policy.safetensors"),
        code=code("collect_demonstrations"),
    output:
        **outputs("collect_demonstrations", DEMONSTRATIONS),
    log:
        f"<logs>/{DEMONSTRATIONS}.log",
    benchmark:
        f"<benchmarks>/{DEMONSTRATIONS}.tsv"
    threads: 1
    resources:
        mem_mb=1200,
    params:
        settings=settings_of(DEMONSTRATIONS),
        expert=folder_of("expert"),
        folder=subpath(output.demonstrations_parquet, parent=True),
    shell:
        "mtcsirl collect-demonstrations --expert {params.expert:q} --task {wildcards.task:q}"
        " --target {wildcards.target:q} --cs-reward {wildcards.cs_reward:q}"
        " --settings {params.settings:q} --output {params.folder:q} > {log:q} 2>&1"
