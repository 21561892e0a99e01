"""The paper's tables: targets table_1 ... table_5, each as CSV, Markdown and LaTeX."""

TABLES = [name for name in ARTEFACTS if name.startswith("table_")]
HEAT_MAPS = ["table_1", "table_3"]  # drawn beside the paper's as well

for table in TABLES:

    rule:
        name:
            table
        input:
            rows=rows_of(table),
            published=PACKAGE / "published.yaml",
            code=code(f"tables/{table}.py", "analysis/rows.py", *["tables/heatmaps.py"][: table in HEAT_MAPS]),
        output:
            csv=f"<results>/tables/{table}.csv",
            markdown=report(f"<results>/tables/{table}.md", caption=f"../report/{table}.rst", category="Tables"),
            latex=f"<results>/tables/{table}.tex",
            heat_map=[f"<results>/tables/{table}.{ending}" for ending in ("pdf", "png") if table in HEAT_MAPS],
        log:
            f"<logs>/tables/{table}.log",
        threads: 1
        params:
            number=table.removeprefix("table_"),
            settings=as_json(SETTINGS),
            folder=subpath(output.csv, parent=True),
        shell:
            "mtcsirl table {params.number:q} --settings {params.settings:q} --output {params.folder:q} > {log:q} 2>&1"
