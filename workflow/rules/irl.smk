"""Inverse reinforcement learning, and how well the learned reward agrees with the truth."""


def demonstrations_of(wildcards):
    """The demonstrations that an IRL run reads: one file per (task, target) that it trains on."""
    return [f"{folder}/demonstrations.parquet" for folder in folders_of(IrlRun, "demonstrations")(wildcards)]


rule learn_reward:
    """Algorithm 1 or 2 over the demonstrations of T (task, target) pairs."""
    input:
        needed_by(IrlRun),
    output:
        made(IrlRun),
    log:
        log_of(IrlRun),
    threads: 1
    resources:
        mem_mb=memory_of(IrlRun),
        runtime=minutes_of(IrlRun),
    params:
        settings=settings_of(IrlRun),
        demonstrations=demonstrations_of,
        folder=subpath(output[0], parent=True),
    shell:
        "mtcsirl learn-reward --method {wildcards.method:q} --cs-reward {wildcards.cs_reward:q}"
        " --seed {wildcards.seed:q} --experiment {wildcards.experiment:q}"
        " --demonstrations {params.demonstrations:q}"
        " --settings {params.settings:q} --output {params.folder:q} --identity {wildcards.identity:q} >> {log:q} 2>&1"


rule score_reward:
    """Correlation of a learned reward with the ground truth on stated transition sets, with controls."""
    input:
        needed_by(Score),
    output:
        made(Score),
    log:
        log_of(Score),
    threads: 1
    resources:
        mem_mb=memory_of(Score),
        runtime=minutes_of(Score),
    params:
        settings=settings_of(Score),
        reward=folders_of(Score, "reward"),
        experts=folders_of(Score, "expert"),
        baselines=folders_of(Score, "baseline"),
        folder=subpath(output[0], parent=True),
    shell:
        "mtcsirl score-reward --reward {params.reward:q} --expert {params.experts:q} --baseline {params.baselines:q}"
        " --task {wildcards.task:q} --target {wildcards.target:q} --cs-reward {wildcards.cs_reward:q}"
        " --seed {wildcards.seed:q} --settings {params.settings:q} --output {params.folder:q}"
        " --identity {wildcards.identity:q} >> {log:q} 2>&1"


rule reward_quality:
    """Every scored reward against the truth, over seeds; no part of `all`."""
    input:
        markers(STUDY.scores),
    output:
        csv="<results>/scores/reward_quality.csv",
        markdown="<results>/scores/reward_quality.md",
        made=page("reward_quality"),
    log:
        "<logs>/scores/reward_quality.log",
    threads: 1
    params:
        settings=as_json(SETTINGS),
        folder=subpath(output.csv, parent=True),
    shell:
        "mtcsirl reward-quality --settings {params.settings:q} --output {params.folder:q} >> {log:q} 2>&1"
