"""Ablations: targets ablation_replay, ablation_temperature, ...; no part of `all`."""

for ablation in ABLATIONS:

    rule:
        name:
            ablation
        input:
            shown_by(ablation),
        output:
            csv=f"<results>/ablations/{ablation}.csv",
            pdf=f"<figures>/{ablation}.pdf",
            png=f"<figures>/{ablation}.png",
            made=page(ablation),
        log:
            f"<logs>/ablations/{ablation}.log",
        threads: 1
        params:
            name=ablation,
            settings=as_json(SETTINGS),
            folder=subpath(output.csv, parent=True),
            figures=subpath(output.pdf, parent=True),
        shell:
            "mtcsirl ablation {params.name:q} --settings {params.settings:q} --output {params.folder:q}"
            " --figures {params.figures:q} >> {log:q} 2>&1"
