"""Inverse reinforcement learning, and how well the learned reward agrees with the truth."""

IRL = "{variant}irl/{experiment}/{method}/{cs_reward}/{source}/s{seed}"
SCORE = "scores/{experiment}/{method}/{cs_reward}/{source}/{task}-t{target}/s{seed}"


rule learn_reward:
    """Algorithm 1 or 2 over the demonstrations of T (task, target) pairs."""
    input:
        demonstrations=demonstrations_of(IRL),
        code=lambda wildcards: code("learn_reward", *method_file(wildcards.method)),
    output:
        **outputs("learn_reward", IRL),
    log:
        f"<logs>/{IRL}.log",
    benchmark:
        f"<benchmarks>/{IRL}.tsv"
    threads: 1
    resources:
        mem_mb=1200,
    params:
        settings=settings_of(IRL),
        folder=subpath(output.gate_json, parent=True),
    shell:
        "mtcsirl learn-reward --method {wildcards.method:q} --cs-reward {wildcards.cs_reward:q}"
        " --seed {wildcards.seed:q} --demonstrations {input.demonstrations:q}"
        " --settings {params.settings:q} --output {params.folder:q} > {log:q} 2>&1"


rule score_reward:
    """Correlation of a learned reward with the ground truth on stated transition sets, with controls."""
    input:
        reward=needed_by(SCORE, "irl", "reward.json", "reward.safetensors", "samples.parquet"),
        expert=needed_by(SCORE, "expert", "policy.json", "policy.safetensors"),
        baseline=needed_by(SCORE, "baseline", "policy.json", "policy.safetensors"),
        code=code("score_reward"),
    output:
        **outputs("score_reward", SCORE),
    log:
        f"<logs>/{SCORE}.log",
    benchmark:
        f"<benchmarks>/{SCORE}.tsv"
    threads: 1
    resources:
        mem_mb=1200,
    params:
        settings=settings_of(SCORE),
        reward=folder_of("reward"),
        expert=folder_of("expert"),
        baseline=folder_of("baseline"),
        folder=subpath(output.scores, parent=True),
    shell:
        "mtcsirl score-reward --reward {params.reward:q} --expert {params.expert:q} --baseline {params.baseline:q}"
        " --task {wildcards.task:q} --target {wildcards.target:q} --cs-reward {wildcards.cs_reward:q}"
        " --seed {wildcards.seed:q}"
        " --settings {params.settings:q} --output {params.folder:q} > {log:q} 2>&1"


rule reward_quality:
    """Every scored reward against the truth, over seeds; no part of `all`."""
    input:
        scores=[path for run in STUDY.scores for path in files(run, "scores.csv", "points.parquet")],
        code=code("results/reward_quality.py"),
    output:
        csv="<results>/scores/reward_quality.csv",
        markdown="<results>/scores/reward_quality.md",
    log:
        "<logs>/scores/reward_quality.log",
    threads: 1
    params:
        settings=as_json(SETTINGS),
        folder=subpath(output.csv, parent=True),
    shell:
        "mtcsirl reward-quality --settings {params.settings:q} --output {params.folder:q} > {log:q} 2>&1"
