"""The paper's figures: targets figure_1 ... figure_9, figure_s1, figure_s2, each as PDF and PNG."""

FIGURES = [name for name in ARTEFACTS if name.startswith("figure_")]
# What a figure that is drawn from no run depends on.
STUDY_KEYS = {"scale", "results", "figures", "single_target", "multi_target", "multi_task", "environment"}


def figure_settings(figure):
    """The configuration, or of it what ``figure`` depends on."""
    return as_json(SETTINGS, None if rows_of(figure) else STUDY_KEYS)


for figure in FIGURES:

    rule:
        name:
            figure
        input:
            rows=rows_of(figure),
            published=PACKAGE / "results/published.yaml",
            code=code(f"figures/{figure}.py", "results/rows.py", "rendering.py"),
        output:
            pdf=f"<figures>/{figure}.pdf",
            png=report(
                f"<figures>/{figure}.png",
                caption=f"../report/{figure}.rst",
                category="Figures",
                labels={"figure": title(figure)},
            ),
        log:
            f"<logs>/figures/{figure}.log",
        threads: 1
        params:
            number=figure.removeprefix("figure_"),
            settings=figure_settings(figure),
            folder=subpath(output.pdf, parent=True),
        shell:
            "mtcsirl figure {params.number:q} --settings {params.settings:q} --output {params.folder:q} > {log:q} 2>&1"
