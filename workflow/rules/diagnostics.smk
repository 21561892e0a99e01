"""What IRL runs logged: a figure for each run, and target diagnostics, a table of all; no part of `all`."""

DRAWN = f"<figures>/diagnostics/{IrlRun.PATTERN}"


rule draw_diagnostics:
    """Discriminators, log pi, temperature, gradients and generators of one run."""
    input:
        lambda wildcards: markers([run_of(IrlRun, wildcards)]),
    output:
        pdf=f"{DRAWN}.pdf",
        png=f"{DRAWN}.png",
    log:
        f"<logs>/diagnostics/{IrlRun.PATTERN}.log",
    threads: 1
    params:
        settings=as_json(SETTINGS, {"scale"}),
        run=lambda wildcards: f"{RESULTS}/{run_of(IrlRun, wildcards).folder}",
    shell:
        "mtcsirl draw-diagnostics --run {params.run:q} --settings {params.settings:q} --output {output.png:q}"
        " >> {log:q} 2>&1"


rule diagnostics:
    """Which discriminators were saturated, asleep or at work, and a figure for every run."""
    input:
        rows=markers(STUDY.irl_runs),
        figures=[f"<figures>/diagnostics/{run.folder}.png" for run in STUDY.irl_runs],
    output:
        csv="<results>/diagnostics/diagnostics.csv",
        markdown="<results>/diagnostics/diagnostics.md",
        made=page("diagnostics"),
    log:
        "<logs>/diagnostics/diagnostics.log",
    threads: 1
    params:
        settings=as_json(SETTINGS),
        folder=subpath(output.csv, parent=True),
    shell:
        "mtcsirl diagnostics --settings {params.settings:q} --output {params.folder:q} >> {log:q} 2>&1"
