"""The verb of the evidence archive: add finished runs, check it, restore runs from it, say what is in it."""

import argparse
from pathlib import Path

from mtcsirl.commands.arguments import Verbs, add_artefact, add_study_settings, add_verb, path, study_settings
from mtcsirl.errors import UserError

ARCHIVE = Path("results/reference")


def register(verbs: Verbs) -> None:
    """Add the verb."""
    verb = add_verb(
        verbs,
        "archive",
        lambda parsed: ACTIONS[parsed.action](parsed),
        does="keep what one needs to check every number without training, and restore runs from it",
        needs="add: finished runs in the results folder; verify, unpack, summary: an archive",
        writes="add: a new part below --archive; unpack: folders of runs below the results; else nothing",
    )
    verb.add_argument("action", choices=tuple(ACTIONS), metavar="ACTION", help=", ".join(ACTIONS))
    verb.add_argument("--archive", type=path, default=ARCHIVE, metavar="DIR", help=f"default: {ARCHIVE}")
    add_artefact(verb)
    add_study_settings(verb)


def _add(parsed: argparse.Namespace) -> None:
    from mtcsirl.results.archive import add, policies_kept
    from mtcsirl.study.design import design
    from mtcsirl.study.standing import DONE, standing

    settings = study_settings(parsed)
    runs = design(settings, parsed.target)
    done = [run.folder for run in runs if standing(run, settings).state == DONE]
    part = add(parsed.archive, Path(settings.results), done, policies_kept(design(settings)))
    print(f"{len(done)} of {sum(runs.jobs().values())} runs are done; {part or 'nothing new to add'}")


def _there(parsed: argparse.Namespace) -> Path:
    from mtcsirl.results.archive import parts

    folder: Path = parsed.archive
    if not parts(folder):
        raise UserError(f"{folder}: no archive there; `archive add` begins one")
    return folder


def _verify(parsed: argparse.Namespace) -> None:
    from mtcsirl.results.archive import archived, verify

    wrong = verify(_there(parsed))
    for line in wrong:
        print(line)
    if wrong:
        raise UserError(f"{parsed.archive}: {len(wrong)} faults")
    runs = len(archived(parsed.archive))
    print(f"{parsed.archive}: {runs} runs; every kept file is what its run wrote")


def _unpack(parsed: argparse.Namespace) -> None:
    from mtcsirl.results.archive import unpack
    from mtcsirl.study.design import design

    settings = study_settings(parsed)
    folders = [run.folder for run in design(settings, parsed.target)]
    found = unpack(_there(parsed), Path(settings.results), folders)
    absent = len(folders) - len(found.restored) - len(found.left_alone)
    print(f"{len(found.restored)} of {len(folders)} runs restored below {settings.results}")
    print(f"{len(found.left_alone)} left alone, as something is there; {absent} not in the archive")


def _summary(parsed: argparse.Namespace) -> None:
    from mtcsirl.results.archive import summary
    from mtcsirl.study.design import design

    planned = design(study_settings(parsed), parsed.target).jobs()
    rows = summary(_there(parsed))
    for what, count, mib in rows:
        of = f"{count:5} of {planned[what]} runs" if what in planned else f"{mib:8.2f} MiB in {count} parts"
        print(f"{what:24}{of}")
    print(f"{'in all':24}{sum(mib for *_, mib in rows):8.2f} MiB")


ACTIONS = {"add": _add, "verify": _verify, "unpack": _unpack, "summary": _summary}
