"""The verbs that read a study's results: tables, figures, claims, results page, report."""

import argparse
import sys
from pathlib import Path
from typing import TYPE_CHECKING, TypeVar

from mtcsirl.commands.arguments import Verbs, add_study_settings, add_verb, new_folder, study_settings
from mtcsirl.commands.drawing import write_figure
from mtcsirl.commands.remedy import Verb, advised
from mtcsirl.commands.signing import Place, note, place, to_be_read
from mtcsirl.settings import Settings
from mtcsirl.study.ablations import ABLATIONS
from mtcsirl.study.artefacts import HEAT_MAPS, not_rendered
from mtcsirl.study.design import ARTEFACTS, CLAIMS, design
from mtcsirl.study.runs import AnyRun
from mtcsirl.study.standing import DONE, standing

if TYPE_CHECKING:
    import pandas as pd

    from mtcsirl.claims.claims import Finding

Kind = TypeVar("Kind", bound=AnyRun)


def register(verbs: Verbs) -> None:
    """Add the verbs."""
    _add(
        verbs,
        "table",
        _table,
        does="make one of the paper's tables",
        writes="table_N.csv, .json, .md, .tex (1, 3: .pdf, .png)",
        numbered=True,
    )
    _add(verbs, "figure", _figure, does="draw one of the paper's figures", writes="figure_N.pdf, .png", numbered=True)
    ablation = _add(verbs, "ablation", _ablation, does="draw an ablation", writes="NAME.csv, .pdf, .png")
    ablation.add_argument("name", choices=tuple(ABLATIONS), metavar="NAME", help=", ".join(ABLATIONS))
    where = "of .pdf and .png; default: --output, else where the DAG puts it"
    ablation.add_argument("--figures", type=new_folder, metavar="DIR", help=where)
    _add(
        verbs,
        "reward-quality",
        _reward_quality,
        does="hold every learned reward that was scored against the truth, over seeds",
        writes="reward_quality.csv, .md",
    )
    _add(
        verbs,
        "reward-preference",
        _reward_preference,
        does="say whether learned rewards pay new agents more than experts, and for what",
        writes="reward_preference.csv, .md",
    )
    _add(
        verbs,
        "diagnostics",
        _diagnostics,
        does="say which discriminators of a study were saturated, asleep or at work",
        writes="diagnostics.csv, .md",
    )
    _add(verbs, "claims", _claims, does="judge the paper's claims", writes="claims.json, .md, .pdf, .png")
    _add(
        verbs,
        "results",
        _results,
        does="write verdicts and tables as one Markdown page",
        writes="results.md",
        home="default: the results folder; --output docs makes docs/results.md",
    )
    _add(verbs, "report", _report, does="make the page that shows everything", writes="index.html")


def _add(
    verbs: Verbs,
    name: str,
    run: Verb,
    *,
    does: str,
    writes: str,
    numbered: bool = False,
    home: str = "default: where the DAG puts it",
) -> argparse.ArgumentParser:
    verb = add_verb(
        verbs,
        name,
        advised(run, _target),
        does=does,
        needs="the study's runs in its results folder; with --partial those that are there",
        writes=f"{writes} into --output",
    )
    if numbered:
        numbers = [n.partition("_")[2] for n in ARTEFACTS if n.startswith(name)]
        verb.add_argument("number", choices=numbers, metavar="N", help=f"as in the paper: {', '.join(numbers)}")
    verb.add_argument("--partial", action="store_true", help="read what is there and mark what is missing")
    add_study_settings(verb)
    verb.add_argument("--output", type=new_folder, metavar="DIR", help=home)
    return verb


def _target(parsed: argparse.Namespace) -> str:
    """What Snakemake calls what this verb makes."""
    if "number" in parsed:
        return f"{parsed.verb}_{parsed.number}"
    return str(parsed.name) if "name" in parsed else {"results": "all"}.get(parsed.verb, parsed.verb.replace("-", "_"))


def _table(parsed: argparse.Namespace) -> None:
    from mtcsirl.files.storage import write_csv, write_json, write_text
    from mtcsirl.results.rows import evaluation_rows
    from mtcsirl.tables import TABLES

    settings = study_settings(parsed)
    name = f"table_{parsed.number}"
    folder, home = place(parsed.output, Path(settings.results) / "tables")
    read = to_be_read(parsed, settings, name)
    rows = evaluation_rows(design(settings, name), settings, partial=parsed.partial)
    table = TABLES[name](rows, settings)
    write_csv(folder / f"{name}.csv", table.csv())
    write_json(folder / f"{name}.json", table.as_json())
    write_text(folder / f"{name}.md", table.markdown())
    write_text(folder / f"{name}.tex", table.latex())
    if name in HEAT_MAPS:
        from mtcsirl.figures.heat_maps import heat_map, heat_map_caption

        cs_reward = HEAT_MAPS[name]
        write_figure(folder / name, heat_map(cs_reward, rows, settings), heat_map_caption(cs_reward, settings))
    note(name, settings, [(folder, home)], partial=parsed.partial, read=read)
    print(table.markdown())


def _figure(parsed: argparse.Namespace) -> None:
    from mtcsirl.figures import figure_spec
    from mtcsirl.figures.data import FigureData
    from mtcsirl.figures.not_rendered import caption as why_not_rendered
    from mtcsirl.figures.not_rendered import words as in_words
    from mtcsirl.results.rows import curve_rows, point_rows, score_rows

    settings = study_settings(parsed)
    name = f"figure_{parsed.number}"
    folder, home = place(parsed.output, Path(settings.figures))
    read = to_be_read(parsed, settings, name)
    study = design(settings, name)
    readers = {"curves": curve_rows, "scores": score_rows, "points": point_rows}
    frames = {what: rows_of(study, settings, partial=parsed.partial) for what, rows_of in readers.items()}
    spec = figure_spec(name)
    data = FigureData(settings=settings, **frames)
    why = not_rendered(name, settings)
    if why is None:
        figure, caption = spec.draw(data), spec.caption(data)
    else:
        figure, caption = in_words(spec.title, why, f"snakemake --cores 2 {name}"), why_not_rendered(why)
    write_figure(folder / name, figure, caption)
    note(name, settings, [(folder, home)], partial=parsed.partial, read=read)
    print(f"{spec.title}. {caption}")


def _reward_quality(parsed: argparse.Namespace) -> None:
    from mtcsirl.results.notes import scale_notes
    from mtcsirl.results.reward_quality import quality_markdown, read_quality

    settings = study_settings(parsed)
    where = place(parsed.output, Path(settings.results) / "scores")
    runs = _there(design(settings).scores, settings, parsed.partial)
    rows = read_quality(runs, settings.results, settings.score.bootstrap)
    _write_summary(parsed, settings, where, rows, quality_markdown(rows, " ".join(scale_notes(settings.scale))))


def _reward_preference(parsed: argparse.Namespace) -> None:
    from mtcsirl.results.notes import scale_notes
    from mtcsirl.results.preference import preferences_markdown, read_preferences

    settings = study_settings(parsed)
    where = place(parsed.output, Path(settings.results) / "reward_preference")
    study = design(settings)
    runs = _there(study.transfers, settings, parsed.partial)
    experts = _there(study.experts, settings, parsed.partial)
    baselines = _there(study.baselines, settings, parsed.partial)
    rows = read_preferences(runs, experts, baselines, settings)
    text = preferences_markdown(rows, " ".join(scale_notes(settings.scale)))
    _write_summary(parsed, settings, where, rows, text)


def _diagnostics(parsed: argparse.Namespace) -> None:
    from mtcsirl.results.diagnosis import diagnoses_markdown, read_diagnoses
    from mtcsirl.results.notes import scale_notes

    settings = study_settings(parsed)
    where = place(parsed.output, Path(settings.results) / "diagnostics")
    rows = read_diagnoses(_there(design(settings).irl_runs, settings, parsed.partial), settings.results)
    _write_summary(parsed, settings, where, rows, diagnoses_markdown(rows, scale_notes(settings.scale)))


def _there(runs: tuple[Kind, ...], settings: Settings, partial: bool) -> tuple[Kind, ...]:
    """All ``runs``; if ``partial``, those that are done."""
    return tuple(run for run in runs if not partial or standing(run, settings).state == DONE)


def _write_summary(
    parsed: argparse.Namespace, settings: Settings, where: Place, rows: "pd.DataFrame", text: str
) -> None:
    """Write rows as CSV and ``text`` as Markdown, and print it."""
    from mtcsirl.files.storage import write_csv, write_text

    name = _target(parsed)
    write_csv(where[0] / f"{name}.csv", rows)
    write_text(where[0] / f"{name}.md", text)
    note(name, settings, [where], partial=parsed.partial)
    print(text)


def _ablation(parsed: argparse.Namespace) -> None:
    from mtcsirl.figures.ablation import caption, draw, variant_rows
    from mtcsirl.files.storage import write_csv
    from mtcsirl.results.rows import evaluation_rows
    from mtcsirl.study.design import variants

    settings, name = study_settings(parsed), parsed.name
    csv = place(parsed.output, Path(settings.results) / "ablations")
    figures = place(parsed.figures or parsed.output, Path(settings.figures))
    shown = variants(settings, name)
    frames = {v: evaluation_rows(study, settings, partial=parsed.partial) for v, study in shown.items()}
    rows = variant_rows(frames)
    write_csv(csv[0] / f"{name}.csv", rows)
    text = caption(name, rows, settings)
    write_figure(figures[0] / name, draw(name, rows, settings), text)
    note(name, settings, [csv, figures], partial=parsed.partial)
    print(text)


def _claims(parsed: argparse.Namespace) -> None:
    from mtcsirl.claims.claims import claims_json, claims_markdown
    from mtcsirl.figures.claims import caption, claims_figure
    from mtcsirl.files.storage import write_json, write_text

    settings = study_settings(parsed)
    folder, home = place(parsed.output, Path(settings.results) / "claims")
    read = to_be_read(parsed, settings, CLAIMS)
    findings = _judged(settings, parsed.partial)
    text = claims_markdown(findings, settings)
    write_json(folder / "claims.json", claims_json(findings, settings))
    write_text(folder / "claims.md", text)
    write_figure(folder / "claims", claims_figure(findings, settings), caption())
    note(CLAIMS, settings, [(folder, home)], partial=parsed.partial, read=read)
    print(text)


def _judged(settings: Settings, partial: bool) -> "list[Finding]":
    import pandas as pd

    from mtcsirl.claims.claims import judge
    from mtcsirl.results.rows import evaluation_rows, last_rows, point_rows, score_rows

    runs = design(settings, CLAIMS)
    rows, last, scores, points = (
        read(runs, settings, partial=partial) for read in (evaluation_rows, last_rows, score_rows, point_rows)
    )
    return judge(pd.concat([rows, last], ignore_index=True), scores, settings, points=points)


def _results(parsed: argparse.Namespace) -> None:
    from mtcsirl.files.storage import write_text
    from mtcsirl.report.results_page import made_with, results_page
    from mtcsirl.results.rows import evaluation_rows
    from mtcsirl.tables import TABLES

    settings = study_settings(parsed)
    folder, _ = place(parsed.output, Path(settings.results))
    rows = {name: evaluation_rows(design(settings, name), settings, partial=parsed.partial) for name in TABLES}
    tables = {name: table(rows[name], settings) for name, table in TABLES.items()}
    made = made_with(design(settings), settings)
    page = folder / "results.md"
    write_text(page, results_page(_judged(settings, parsed.partial), tables, settings, provenance=made))
    print(page)


def _report(parsed: argparse.Namespace) -> None:
    from mtcsirl.files.storage import write_text
    from mtcsirl.report.collect import collect
    from mtcsirl.report.page import build_report

    settings = study_settings(parsed)
    folder, home = place(parsed.output, Path(settings.results) / "report")
    page = folder / "index.html"
    data = collect(settings, page, partial=parsed.partial)
    write_text(page, build_report(data))
    note("report", settings, [(folder, home)], partial=parsed.partial, files=page.name)
    for caution in data.cautions:
        print(f"mtcsirl: {caution}", file=sys.stderr)
    print(page)
