"""The paper's tables: targets table_1 ... table_5, each as CSV, JSON, Markdown and LaTeX."""

TABLES = [name for name in ARTEFACTS if name.startswith("table_")]


def title(artefact):
    """As in "Table 2" or "Figure S1", for labels."""
    kind, _, number = artefact.partition("_")
    return f"{kind.capitalize()} {number.upper()}"


def heat_map(table):
    """The files of a table's heat map, none for tables without one."""
    if table not in HEAT_MAPS:
        return []
    picture = report(
        f"<results>/tables/{table}.png",
        caption=f"../report/{table}.rst",
        category="Tables",
        labels={"table": title(table), "form": "heat map, paper and ours"},
    )
    return [f"<results>/tables/{table}.pdf", picture]


for table in TABLES:

    rule:
        name:
            table
        input:
            shown_by(table),
        output:
            csv=f"<results>/tables/{table}.csv",
            json=f"<results>/tables/{table}.json",
            markdown=report(
                f"<results>/tables/{table}.md",
                caption=f"../report/{table}.rst",
                category="Tables",
                labels={"table": title(table), "form": "numbers"},
            ),
            latex=f"<results>/tables/{table}.tex",
            heat_map=heat_map(table),
            made=page(table),
        log:
            f"<logs>/tables/{table}.log",
        threads: 1
        params:
            number=table.removeprefix("table_"),
            settings=as_json(SETTINGS),
            folder=subpath(output.csv, parent=True),
        shell:
            "mtcsirl table {params.number:q} --settings {params.settings:q} --output {params.folder:q} >> {log:q} 2>&1"
