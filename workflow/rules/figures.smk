"""The paper's figures: targets figure_1 ... figure_9, figure_s1, figure_s2, each as PDF and PNG."""

FIGURES = [name for name in ARTEFACTS if name.startswith("figure_")]

for figure in FIGURES:

    rule:
        name:
            figure
        input:
            shown_by(figure),
        output:
            pdf=f"<figures>/{figure}.pdf",
            png=report(
                f"<figures>/{figure}.png",
                caption=f"../report/{figure}.rst",
                category="Figures",
                labels={"figure": title(figure)},
            ),
            made=page(figure),
        log:
            f"<logs>/figures/{figure}.log",
        threads: 1
        params:
            number=figure.removeprefix("figure_"),
            settings=as_json(SETTINGS),
            folder=subpath(output.pdf, parent=True),
        shell:
            "mtcsirl figure {params.number:q} --settings {params.settings:q} --output {params.folder:q} >> {log:q} 2>&1"
