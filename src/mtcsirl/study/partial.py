"""Pages of a part of a study: what they were made from is noted apart from records, so no workflow takes them for done.

The note is a record of the same form, ``<results>/artefacts/<name>/partial.json``: the identity that the whole page
would have under these settings, the checksums of its files, and which runs were there to be read.
"""

import os
from collections.abc import Iterable, Mapping
from pathlib import Path

from mtcsirl.errors import UserError
from mtcsirl.files import storage
from mtcsirl.files.identity import Record, checksum, differences, dumps, lost, parse_record
from mtcsirl.settings import Settings
from mtcsirl.study.artefacts import altered, artefact_identity, artefact_standing, record_folder
from mtcsirl.study.runs import AnyRun
from mtcsirl.study.standing import ABSENT, DONE, INCOMPLETE, STALE, Standing, standing

NOTE = "partial.json"
REMAKE = "make it again"
"""The way out of a damaged note."""


def done_runs(study: Iterable[AnyRun], settings: Settings) -> dict[str, str]:
    """The digest of the bytes of every run that is done, by its folder."""
    found = ((run.folder, standing(run, settings)) for run in study)
    return {folder: said.record.bytes for folder, said in found if said.state == DONE and said.record is not None}


def note_partial(name: str, settings: Settings, files: Iterable[Path], done: Mapping[str, str]) -> None:
    """Note what ``files`` were made from, after they were written; ``done``: the runs that were done before."""
    folder = record_folder(name, settings.results)
    sums = {Path(os.path.relpath(file, folder)).as_posix(): checksum(file) for file in files}
    storage.write_text(folder / NOTE, dumps(Record(artefact_identity(name, settings), sums, done)))


def forget_partial(name: str, settings: Settings) -> None:
    """Take the note away: the page is of the whole study now."""
    storage.remove(record_folder(name, settings.results) / NOTE)


def page_standing(name: str, settings: Settings, done: Mapping[str, str]) -> Standing:
    """How an artefact stands that may be of a part of the study; ``done``: as ``done_runs`` of the whole study.

    A page of a part is done where it was made under these settings from runs that are done still.
    """
    signed = artefact_standing(name, settings)
    return signed if signed.state != ABSENT else _partial_standing(name, settings, done)


def _partial_standing(name: str, settings: Settings, done: Mapping[str, str]) -> Standing:
    folder = record_folder(name, settings.results)
    if not (folder / NOTE).is_file():
        return Standing(ABSENT, ("nothing says what it was made from",))
    try:
        record = parse_record(storage.read_text(folder / NOTE), str(folder / NOTE), REMAKE)
    except UserError as error:
        return Standing(INCOMPLETE, (str(error),))
    wanted = artefact_identity(name, settings)
    if record.identity.hash != wanted.hash:
        return Standing(STALE, tuple(differences(record.identity, wanted)), record)
    damage = [f"lost {Path(file).name}" for file in lost(folder, record)] + altered(folder, record)
    if damage:
        return Standing(INCOMPLETE, tuple(damage), record)
    gone = sorted(run for run, digest in record.read.items() if done.get(run) != digest)
    if gone:
        return Standing(STALE, (f"{gone[0]}, which it shows, is no longer done or was made again",), record)
    return Standing(DONE, (), record)


def done_since(record: Record, done: Mapping[str, str]) -> int:
    """How many runs a page of a part would show today that it does not; none of a page of the whole."""
    return sum(run in done and run not in record.read for run in record.identity.inputs)
