"""Demonstrations: episodes of a stochastic expert."""


rule collect_demonstrations:
    """Episodes of the expert with the task reward, as Parquet."""
    input:
        needed_by(Demonstrations),
    output:
        made(Demonstrations),
    log:
        log_of(Demonstrations),
    threads: 1
    resources:
        mem_mb=memory_of(Demonstrations),
        runtime=minutes_of(Demonstrations),
    params:
        settings=settings_of(Demonstrations),
        expert=folders_of(Demonstrations, "expert"),
        folder=subpath(output[0], parent=True),
    shell:
        "mtcsirl collect-demonstrations --expert {params.expert:q} --task {wildcards.task:q}"
        " --target {wildcards.target:q} --cs-reward {wildcards.cs_reward:q} --seed {wildcards.seed:q}"
        " --settings {params.settings:q} --output {params.folder:q} --identity {wildcards.identity:q} >> {log:q} 2>&1"
