"""A known reward on a point mass; not part of ``all``."""


rule validation:
    """MT-CSIRL and its controls where the truth is known."""
    output:
        correlations="<results>/validation/correlations.csv",
        agents="<results>/validation/agents.csv",
        curve="<results>/validation/curve.csv",
        pdf="<figures>/validation.pdf",
        png="<figures>/validation.png",
        made=page("validation"),
    log:
        "<logs>/validation.log",
    threads: 2
    params:
        folder=subpath(output.curve, parent=True),
        figures=subpath(output.pdf, parent=True),
        results=SETTINGS.results,
    shell:
        "mtcsirl validate --output {params.folder:q} --figures {params.figures:q} --results {params.results:q}"
        " --processes {threads} >> {log:q} 2>&1"
