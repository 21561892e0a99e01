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


rule reward_preference:
    """Whether the reward pays new agents more than experts, and for what; no part of `all`."""
    input:
        markers([*STUDY.experts, *STUDY.baselines, *STUDY.transfers]),
    output:
        csv="<results>/reward_preference/reward_preference.csv",
        markdown="<results>/reward_preference/reward_preference.md",
        made=page("reward_preference"),
    log:
        "<logs>/reward_preference/reward_preference.log",
    threads: 1
    params:
        settings=as_json(SETTINGS),
        folder=subpath(output.csv, parent=True),
    shell:
        "mtcsirl reward-preference --settings {params.settings:q} --output {params.folder:q} >> {log:q} 2>&1"
