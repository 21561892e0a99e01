"""A known reward on a point mass; not part of ``all``."""


rule validation:
    """MT-CSIRL and its controls where the truth is known."""
    input:
        code=code("validation/recovery.py", "validation/figure.py", "irl/methods/mt_csirl.py"),
    output:
        correlations="<results>/validation/correlations.csv",
        agents="<results>/validation/agents.csv",
        curve="<results>/validation/curve.csv",
        pdf="<figures>/validation.pdf",
        png="<figures>/validation.png",
    log:
        "<logs>/validation.log",
    benchmark:
        "<benchmarks>/validation.tsv"
    threads: 2
    params:
        folder=subpath(output.curve, parent=True),
        figures=subpath(output.pdf, parent=True),
    shell:
        "mtcsirl validate --output {params.folder:q} --figures {params.figures:q} --processes {threads} > {log:q} 2>&1"
