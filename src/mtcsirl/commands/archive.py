"""The verb of the evidence archive: add finished runs, check it, restore runs, draw some to make again, take files."""

import argparse
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from mtcsirl.commands.arguments import (
    Verbs,
    add_artefact,
    add_study_settings,
    add_verb,
    natural,
    path,
    refusing,
    seed,
    study_settings,
)
from mtcsirl.errors import UserError
from mtcsirl.files.console import plain

if TYPE_CHECKING:
    from collections.abc import Collection, Mapping

    from mtcsirl.results.archive import Archived
    from mtcsirl.settings import Settings
    from mtcsirl.study.runs import Runs

ARCHIVE = Path("results/reference")


def register(verbs: Verbs) -> None:
    """Add the verb."""
    verb = add_verb(
        verbs,
        "archive",
        _act,
        does="keep what one needs to check every number without training, restore runs, and hold new ones against it",
        needs="add: finished runs in the results folder; compare: runs that were made again there; fill: restored runs "
        "there and others made again in --again; else an archive",
        writes="add: a new part below --archive; unpack, draw: folders of runs below the results; fill: files that the "
        "archive had not kept, below the results; else nothing",
    )
    verb.add_argument("action", choices=tuple(ACTIONS), metavar="ACTION", help=", ".join(ACTIONS))
    verb.add_argument("--archive", type=path, metavar="DIR", help=f"all but fill; default: {ARCHIVE}")
    verb.add_argument("--agents", type=natural, metavar="N", help="draw: so many agents; default 12")
    verb.add_argument("--irl-runs", type=natural, metavar="N", help="draw: so many IRL runs; default 2")
    verb.add_argument("--draw-seed", type=seed, metavar="SEED", help="draw: decides which; default 0")
    verb.add_argument("--runs", type=natural, metavar="N", help="verify: fail unless the archive holds so many runs")
    verb.add_argument("--again", type=path, metavar="DIR", help="fill: the results folder to take files from")
    replacing = "add: also runs of other settings, code or inputs than those that it holds"
    verb.add_argument("--replace", action="store_const", const=True, help=replacing)
    add_artefact(verb)
    add_study_settings(verb)


def _act(parsed: argparse.Namespace) -> None:
    """Refuse what the action would not look at, and take it with the defaults of the rest."""
    asked = [name for name in DEFAULTS if getattr(parsed, name) is not None]
    if wrong := [name for name in asked if name not in TAKEN[parsed.action]]:
        raise UserError(f"archive {parsed.action}: takes no --{wrong[0].replace('_', '-')}; leave it out")
    for name in set(DEFAULTS) - set(asked):
        setattr(parsed, name, DEFAULTS[name])
    ACTIONS[parsed.action](parsed)


def _add(parsed: argparse.Namespace) -> None:
    from mtcsirl.results.archive import add, policies_kept
    from mtcsirl.study.design import design
    from mtcsirl.study.standing import DONE, standing

    settings = study_settings(parsed)
    runs = design(settings, parsed.target)
    done = [run.folder for run in runs if standing(run, settings).state == DONE]
    policies = policies_kept(design(settings))
    part = add(parsed.archive, Path(settings.results), done, policies, replace=bool(parsed.replace))
    print(f"{len(done)} of {sum(runs.jobs().values())} runs are done; {part or 'nothing new to add'}")


def _there(parsed: argparse.Namespace) -> Path:
    from mtcsirl.results.archive import parts

    folder: Path = parsed.archive
    if not parts(folder):
        raise UserError(f"{folder}: no archive there; `archive add` begins one")
    return folder


def _verify(parsed: argparse.Namespace) -> None:
    from mtcsirl.results.archive import archived, unverified, verify

    folders = _asked(parsed)
    wrong = verify(_there(parsed), folders)
    for line in wrong:
        print(plain(line))
    if wrong:
        raise UserError(f"{parsed.archive}: {len(wrong)} faults")
    known = archived(parsed.archive)
    if parsed.runs is not None and len(known) != parsed.runs:
        raise UserError(f"{parsed.archive}: {len(known)} runs, not {parsed.runs}; get the parts that are missing")
    own = [run for folder, run in known.items() if folders is None or folder in folders]
    of = "" if folders is None else f" of {len(folders)} of {parsed.target}"
    print(f"{parsed.archive}: {len(own)} runs{of}; every kept file is what its run wrote")
    for line in unverified(own):
        print(line)


def _asked(parsed: argparse.Namespace) -> set[str] | None:
    """Folders of the runs of ``--target``; None without one."""
    from mtcsirl.study.design import design

    return {run.folder for run in design(study_settings(parsed), parsed.target)} if parsed.target else None


def _unpack(parsed: argparse.Namespace) -> None:
    from mtcsirl.results.archive import archived, unpack
    from mtcsirl.study.design import design

    settings = study_settings(parsed)
    folders = [run.folder for run in design(settings, parsed.target)]
    found = unpack(_there(parsed), Path(settings.results), folders)
    absent = len(folders) - len(found.restored) - len(found.left_alone)
    print(f"{len(found.restored)} of {len(folders)} runs restored below {settings.results}")
    print(f"{len(found.left_alone)} left alone, as something is there; {absent} not in the archive")
    _say_others(archived(parsed.archive), design(settings, parsed.target), settings)


def _say_others(known: "Mapping[str, Archived]", study: "Runs", settings: "Settings") -> None:
    """Name the archived runs that the present settings and code would make otherwise."""
    from mtcsirl.results.archive import another
    from mtcsirl.study.keys import identity_of

    why = [
        another(known[run.folder].record.identity, identity_of(run, settings)) for run in study if run.folder in known
    ]
    if other := [one for one in why if one]:
        print(f"{len(other)} of these are stale under the present settings and code, the first {other[0][3:]}")


def _summary(parsed: argparse.Namespace) -> None:
    from mtcsirl.results.archive import archived, summary
    from mtcsirl.study.design import design

    study = design(study_settings(parsed), parsed.target)
    planned, folders = study.jobs(), {run.folder for run in study}
    rows = summary(_there(parsed), folders)
    for what, number, mib in rows:
        of = f"{number:5} of {planned[what]} runs" if what in planned else f"{mib:8.2f} MiB in {number} parts"
        print(f"{what:24}{of}")
    known = archived(parsed.archive)
    if others := set(known) - folders:
        print(f"{'other runs':24}{len(others):5}")
    print(f"{'in all':24}{sum(mib for *_, mib in rows):8.2f} MiB")
    _say_others(known, study, study_settings(parsed))


def _draw(parsed: argparse.Namespace) -> None:
    with refusing():
        _draw_runs(parsed)


def _draw_runs(parsed: argparse.Namespace) -> None:
    """Restore all but some runs and what they read that was not kept; print what to ask snakemake for."""
    from mtcsirl.files.identity import marker
    from mtcsirl.results.again import draw, refuse_others, to_be_made
    from mtcsirl.results.archive import archived, unpack
    from mtcsirl.study.design import design
    from mtcsirl.study.keys import identity_of

    settings = study_settings(parsed)
    results, study = Path(settings.results), design(settings, parsed.target)
    known = archived(_there(parsed))
    drawn = draw(known, study, parsed.agents, parsed.irl_runs, parsed.draw_seed)
    refuse_others(drawn, known, settings)
    made = to_be_made(drawn, known)
    if there := [folder for folder in sorted(made) if (results / folder).exists()]:
        raise UserError(f"{results / there[0]}: is there; choose a folder without it: --set results=FOLDER")
    unpack(parsed.archive, results, [run.folder for run in study if run.folder not in made])
    print(f"{len(made)} runs to make, {len(drawn)} drawn; then archive compare", file=sys.stderr)
    for run in drawn:
        print(results / run.folder / marker(identity_of(run, settings).hash))


def _compare(parsed: argparse.Namespace) -> None:
    from mtcsirl.results.again import compare
    from mtcsirl.results.archive import archived

    results, asked = Path(study_settings(parsed).results), _asked(parsed)
    known = {folder: run for folder, run in archived(_there(parsed)).items() if asked is None or folder in asked}
    found = compare(parsed.archive, known, results)
    for folder, why in found.left_out:
        print(plain(f"{folder}: not compared: {why}"))
    if not found.made:
        raise UserError(f"{results}: no archived run was made again there; archive draw says what to make")
    for one in found.made:
        same = f"{one.files - len(one.other)} of {one.files} files equal"
        apart = ", ".join(f"{name} {there:.3g} -> {here:.3g}" for name, (there, here) in one.apart.items())
        print(f"{one.folder}: {same}{'; ' if one.other else ''}{apart or ', '.join(one.other)}")
    equal = sum(not one.other for one in found.made)
    rest = f"; {len(found.left_out)} not compared" if found.left_out else ""
    print(f"{equal} of {len(found.made)} runs have the archive's bytes{rest}")


def _fill(parsed: argparse.Namespace) -> None:
    from mtcsirl.results.filling import fill, only_restored
    from mtcsirl.study.design import design

    if parsed.again is None:
        raise UserError("archive fill: name the results folder to take files from: --again DIR")
    settings = study_settings(parsed)
    results, folders = Path(settings.results), [run.folder for run in design(settings, parsed.target)]
    found = fill(results, parsed.again, folders)
    for name, why in found.left:
        print(plain(f"{name}: {why}; left alone"))
    print(f"{len(found.taken)} files taken from {parsed.again}, {len(found.left)} left alone")
    print(f"{len(found.missing)} that the archive had not kept are still missing below {results}")
    if not found.taken and (restored := only_restored(parsed.again, found.missing)):
        print(f"{len(restored)} of these were restored in {parsed.again} as well, not made again: {restored[0]}")


DEFAULTS = {
    "archive": ARCHIVE, "agents": 12, "irl_runs": 2, "draw_seed": 0, "runs": None, "again": None, "replace": None
}  # fmt: skip
TAKEN: "Mapping[str, Collection[str]]" = {
    "add": ("archive", "replace"),
    "verify": ("archive", "runs"),
    "unpack": ("archive",),
    "summary": ("archive",),
    "draw": ("archive", "agents", "irl_runs", "draw_seed"),
    "compare": ("archive",),
    "fill": ("again",),
}
"""What each action looks at beside ``--target`` and the options of a study."""
ACTIONS = {
    "add": _add,
    "verify": _verify,
    "unpack": _unpack,
    "summary": _summary,
    "draw": _draw,
    "compare": _compare,
    "fill": _fill,
}
