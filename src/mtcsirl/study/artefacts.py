"""What a table, a figure or a page is made from, and where that is noted: the identity of an artefact.

Artefacts lie side by side in a few folders, so the record of each stands in a folder of its own,
``<results>/artefacts/<name>/``, and names its files from there.
"""

import os
from collections.abc import Iterable, Mapping
from contextlib import suppress
from dataclasses import replace
from pathlib import Path

from mtcsirl.errors import UserError
from mtcsirl.files import storage
from mtcsirl.files.identity import (
    FILE,
    Identity,
    Record,
    checksum,
    dumps,
    lost,
    read_record,
    write_marker,
)
from mtcsirl.settings import Settings
from mtcsirl.settings.base import identifying
from mtcsirl.study.ablations import ABLATIONS
from mtcsirl.study.code import artefact_code
from mtcsirl.study.design import ARTEFACTS, CLAIMS, design
from mtcsirl.study.keys import identity_of
from mtcsirl.study.standing import DONE, INCOMPLETE, STALE, Standing, of_folder
from mtcsirl.worlds.drawable import lacking

PLACES = {"results", "figures", "extensions"}
"""Keys that say where things are, not what they are."""
DRAWN_FROM = {"scale", "single_target", "multi_target", "multi_task", "environment"}
"""Keys that a figure which is drawn from no run depends on."""
RENDERED = ("figure_8", "figure_9")
"""Figures that show MuJoCo scenes; where a machine cannot draw these, words stand in their place."""
HEAT_MAPS = {"table_1": "action_norm", "table_3": "velocity"}
"""Tables that are also drawn, beside the paper's, and their cs-reward."""
OTHERS: Mapping[str, tuple[str, ...]] = {
    CLAIMS: ("claims.claims", "figures.claims", "results.rows"),
    "report": ("report.collect", "report.page"),
    "reward_quality": ("results.reward_quality",),
    "reward_preference": ("results.preference",),
    "diagnostics": ("results.diagnosis",),
    "validation": ("validation.recovery", "validation.figure", "irl.methods.mt_csirl"),
}
"""Modules that make what is neither a table, a figure nor an ablation."""


def modules_of(name: str) -> tuple[str, ...]:
    """The modules that make an artefact."""
    if name in OTHERS:
        return OTHERS[name]
    if name in ABLATIONS:
        return "figures.ablation", "results.rows"
    kind = name.partition("_")[0]
    drawn = ("figures.heat_maps",) if name in HEAT_MAPS else ()
    return f"{kind}s.{name}", "results.rows", *drawn


def artefact_identity(name: str, settings: Settings) -> Identity:
    """What the artefact ``name`` is made from under ``settings``."""
    if name == "report":
        inputs = {shown: artefact_identity(shown, settings).hash for shown in (*ARTEFACTS, CLAIMS)}
    elif name == "validation":
        return Identity(name, {}, {}, artefact_code(*modules_of(name)), {})
    else:
        whole = None if name in OTHERS and name != CLAIMS else name
        inputs = {run.folder: identity_of(run, settings).hash for run in design(settings, whole)}
    said = {key: value for key, value in identifying(settings).items() if key not in PLACES}
    if name.startswith("figure_") and not inputs:
        said = {key: value for key, value in said.items() if key in DRAWN_FROM}
    drawn = Identity(name, {}, said, artefact_code(*modules_of(name)), inputs)
    if name not in RENDERED or lacking() is None or _is_there(drawn, settings):
        return drawn
    return replace(drawn, settings=said | {"rendered": "no"})


def not_rendered(name: str, settings: Settings) -> str | None:
    """Why words stand in place of the artefact ``name``; None where it is drawn, or a picture of today is there."""
    return lacking() if artefact_identity(name, settings).settings.get("rendered") == "no" else None


def _is_there(drawn: Identity, settings: Settings) -> bool:
    """A picture that another machine drew stays, unless it is damaged."""
    folder = record_folder(drawn.stage, settings.results)
    try:
        record = read_record(folder)
    except UserError:
        return False
    if record is None or record.identity.hash != drawn.hash:
        return False
    return not lost(folder, record) and not altered(folder, record)


def record_folder(name: str, results: Path | str) -> Path:
    """Where the record of an artefact stands."""
    return Path(results) / "artefacts" / name


def artefact_standing(name: str, settings: Settings) -> Standing:
    """As :func:`mtcsirl.study.standing.standing`, of an artefact, whose few files are held against their checksums."""
    folder = record_folder(name, settings.results)
    found = of_folder(folder, lambda: artefact_identity(name, settings))
    record = found.record
    if found.state != DONE or record is None:
        return found
    if changed := altered(folder, record):
        return Standing(INCOMPLETE, tuple(changed), record)
    if dict(record.read) != read_bytes(record.read, settings.results):
        return Standing(STALE, ("a run that it shows was made again with other bytes",), record)
    return found


def altered(folder: Path, record: Record) -> list[str]:
    """Which files of a record have other bytes than were signed, each in words."""
    there = [(folder / name, wanted) for name, wanted in record.files.items() if (folder / name).is_file()]
    return [f"{path.name} changed since it was written" for path, wanted in there if checksum(path) != wanted]


def read_bytes(folders: Iterable[str], results: Path | str) -> dict[str, str]:
    """The digest of the bytes of runs by their folder, of those that are there and have a readable record."""
    found = {}
    for folder in folders:
        with suppress(UserError):
            record = read_record(Path(results) / folder)
            if record is not None:
                found[folder] = record.bytes
    return found


def sign_artefact(name: str, settings: Settings, files: Iterable[Path]) -> None:
    """Note what ``files`` were made from, after they were written."""
    folder = record_folder(name, settings.results)
    folder.mkdir(parents=True, exist_ok=True)
    made_from = artefact_identity(name, settings)
    sums = {Path(os.path.relpath(file, folder)).as_posix(): checksum(file) for file in files}
    runs = [] if name == "report" else made_from.inputs
    record = Record(made_from, sums, read_bytes(runs, settings.results))
    storage.write_text(folder / FILE, dumps(record))
    write_marker(folder, made_from.hash)


def unsign_artefact(name: str, settings: Settings) -> None:
    """Take the note away: what is written now is of a part of the study, or goes elsewhere."""
    folder = record_folder(name, settings.results)
    if folder.is_dir():
        storage.remove(folder / FILE)
        write_marker(folder, None)


def settle_artefacts(names: Iterable[str], settings: Settings, *, mark: bool = True) -> dict[str, str]:
    """As :func:`mtcsirl.study.standing.settle`, of artefacts."""
    wanted = {}
    for name in names:
        wanted[name] = artefact_identity(name, settings).hash
        folder = record_folder(name, settings.results)
        if mark and folder.is_dir():
            write_marker(folder, wanted[name] if artefact_standing(name, settings).state == DONE else None)
    return wanted
