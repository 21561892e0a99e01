"""The verdicts on the paper's claims, and the page that shows everything."""


rule claims:
    """Verdict per claim, from the rows of every run."""
    input:
        rows=rows_of(None),
        published=PACKAGE / "results/published.yaml",
        criteria=PACKAGE / "claims/claims.yaml",
        code=code("claims"),
    output:
        json="<results>/claims/claims.json",
        markdown=report(
            "<results>/claims/claims.md",
            caption="../report/claims.rst",
            category="Claims",
            labels={"claims": "C1 to C12", "form": "every number"},
        ),
        pdf="<results>/claims/claims.pdf",
        png=report(
            "<results>/claims/claims.png",
            caption="../report/claims.rst",
            category="Claims",
            labels={"claims": "C1 to C12", "form": "one page"},
        ),
    log:
        "<logs>/claims.log",
    threads: 1
    params:
        settings=as_json(SETTINGS),
        folder=subpath(output.json, parent=True),
    shell:
        "mtcsirl claims --settings {params.settings:q} --output {params.folder:q} > {log:q} 2>&1"


rule report:
    """One page that opens in a browser: what was run, verdicts, tables, figures, gates, deviations."""
    input:
        tables=expand("<results>/tables/{table}.{ending}", table=TABLES, ending=["csv", "json", "md", "tex"]),
        heat_maps=expand("<results>/tables/{table}.png", table=HEAT_MAPS),
        figures=expand("<figures>/{figure}.{ending}", figure=FIGURES, ending=["pdf", "png"]),
        claims=rules.claims.output,
        provenance=[path for run in STUDY for path in files(run, "provenance.json")],
        page=multiext(str(PACKAGE / "report/page"), ".html", ".css", ".js"),
        code=code("report"),
    output:
        report(
            "<results>/report/index.html",
            caption="../report/start.rst",
            category="Start page",
            labels={"page": "everything, to be read from the top"},
        ),
    log:
        "<logs>/report.log",
    threads: 1
    params:
        settings=as_json(SETTINGS),
        folder=subpath(output[0], parent=True),
    shell:
        "mtcsirl report --settings {params.settings:q} --output {params.folder:q} > {log:q} 2>&1"
