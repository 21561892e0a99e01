"""What IRL runs logged: a figure for each run, and target diagnostics, a table of all; no part of `all`."""

DRAWN = f"<figures>/diagnostics/{IRL}"


rule draw_diagnostics:
    """Discriminators, log pi, temperature, gradients and generators of one run."""
    input:
        run=lambda wildcards: files(run_of(IRL, wildcards), "reward.json", "curve.csv", "diagnostics.csv"),
        code=code("figures/diagnostics.py"),
    output:
        pdf=f"{DRAWN}.pdf",
        png=f"{DRAWN}.png",
    log:
        f"<logs>/diagnostics/{IRL}.log",
    threads: 1
    params:
        settings=as_json(SETTINGS, {"scale"}),
        run=folder_of("run"),
    shell:
        "mtcsirl draw-diagnostics --run {params.run:q} --settings {params.settings:q} --output {output.png:q}"
        " > {log:q} 2>&1"


rule diagnostics:
    """Which discriminators were saturated, asleep or at work, and a figure for every run."""
    input:
        rows=[path for run in STUDY.irl_runs for path in files(run, "diagnostics.csv", "gate.json")],
        figures=[f"<figures>/diagnostics/{run.folder}.png" for run in STUDY.irl_runs],
        code=code("results/diagnosis.py"),
    output:
        csv="<results>/diagnostics/diagnostics.csv",
        markdown="<results>/diagnostics/diagnostics.md",
    log:
        "<logs>/diagnostics/diagnostics.log",
    threads: 1
    params:
        settings=as_json(SETTINGS),
        folder=subpath(output.csv, parent=True),
    shell:
        "mtcsirl diagnostics --settings {params.settings:q} --output {params.folder:q} > {log:q} 2>&1"
