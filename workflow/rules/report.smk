"""The verdicts on the paper's claims, and the page that shows everything."""


rule claims:
    """Verdict per claim, from the rows of every run."""
    input:
        shown_by(CLAIMS),
    output:
        json="<results>/claims/claims.json",
        markdown=report(
            "<results>/claims/claims.md",
            caption="../report/claims.rst",
            category="Claims",
            labels={"claims": "C1 to C13", "form": "every number"},
        ),
        pdf="<results>/claims/claims.pdf",
        png=report(
            "<results>/claims/claims.png",
            caption="../report/claims.rst",
            category="Claims",
            labels={"claims": "C1 to C13", "form": "one page"},
        ),
        made=page(CLAIMS),
    log:
        "<logs>/claims.log",
    threads: 1
    params:
        settings=as_json(SETTINGS),
        folder=subpath(output.json, parent=True),
    shell:
        "mtcsirl claims --settings {params.settings:q} --output {params.folder:q} >> {log:q} 2>&1"


rule report:
    """One page that opens in a browser: what was run, verdicts, tables, figures, gates, deviations."""
    input:
        [ancient(page(name)) for name in (*ARTEFACTS, CLAIMS)],
    output:
        page=report(
            "<results>/report/index.html",
            caption="../report/start.rst",
            category="Start page",
            labels={"page": "everything, to be read from the top"},
        ),
        made=page("report"),
    log:
        "<logs>/report.log",
    threads: 1
    params:
        settings=as_json(SETTINGS),
        folder=subpath(output.page, parent=True),
    shell:
        "mtcsirl report --settings {params.settings:q} --output {params.folder:q} >> {log:q} 2>&1"
