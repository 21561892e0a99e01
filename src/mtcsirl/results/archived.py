"""Which runs an archive holds, by the records in its parts."""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from mtcsirl.errors import UserError
from mtcsirl.files.identity import FILE, Identity, Record, differences, parse_record
from mtcsirl.results.packing import INDEX, PROVENANCE, TEXTS
from mtcsirl.results.parts import AGAIN, check, frame, parts


@dataclass(frozen=True)
class Archived:
    """One run in the archive."""

    folder: str
    part: str
    record: Record
    kept: frozenset[str]
    """Its result files that come back."""
    provenance: str
    """SHA-256 of its ``provenance.json``; a run that was made again has another."""


def archived(archive: Path) -> dict[str, Archived]:
    """The runs of the archive by their folder; of a run that was added twice, the last.

    Raises:
        UserError: a part is damaged.
    """
    return {run.folder: run for part in parts(archive) for run in _of_part(part)}


def _of_part(part: Path) -> Iterator[Archived]:
    check(part)
    texts, index = frame(part, TEXTS), frame(part, INDEX)
    names = index[index["kept"]].groupby("folder", observed=True)["file"].agg(frozenset).to_dict()
    provenance = index[index["file"] == PROVENANCE].groupby("folder", observed=True)["sha256"].last().to_dict()
    identities = texts.loc[texts["file"] == FILE, ["folder", "content"]]
    for folder in sorted({*index["folder"], *texts["folder"]} - set(identities["folder"])):
        raise UserError(f"{part}: {folder!r} lacks its {FILE}; {AGAIN}")
    for folder, text in identities.itertuples(index=False):
        record = parse_record(text, f"{part}: {folder!r}", AGAIN)
        own = names.get(folder, frozenset()) & frozenset(record.files)
        yield Archived(folder, part.name, record, own, provenance.get(folder, ""))


def another(archived: Identity, other: Identity) -> str:
    """The first difference between two runs; empty if there is none."""
    if archived.hash == other.hash:
        return ""
    first = next(differences(archived, other), f"identity: {archived.hash} -> {other.hash}")
    return f"is another run than the archive's: {first}"
