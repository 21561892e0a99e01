"""What stands below a table or figure, as objects: whoever prints them chooses by kind, never by how a text begins."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Literal, get_args

from mtcsirl.settings import Settings
from mtcsirl.settings.template import deviations

Kind = Literal["scale", "gap", "mark", "remark", "deviation"]
KINDS: tuple[Kind, ...] = get_args(Kind)
"""scale: of which study the numbers are; gap: what is not there, and what the study leaves out; mark: what a sign in a
cell means; remark: how to read the numbers; deviation: a setting that is not the paper's."""
SMOKE_NOTE = "smoke scale: numbers mean nothing"


@dataclass(frozen=True)
class Note:
    """One note. ``short``: the same in few words, for a page of paper; empty where the text is short enough."""

    kind: Kind
    text: str
    short: str = ""


def of_kind(notes: Iterable[Note], *kinds: Kind) -> tuple[Note, ...]:
    """The notes of these kinds, in their order."""
    return tuple(note for note in notes if note.kind in kinds)


def scale_notes(scale: str) -> list[str]:
    """The line that every smoke artefact carries; none at other scales."""
    return [SMOKE_NOTE] if scale == "smoke" else []


def study_note(settings: Settings) -> Note:
    """What every table says first: scale and seeds, or that smoke numbers mean nothing."""
    seeds = ", ".join(map(str, settings.seeds))
    count = "1 seed" if len(settings.seeds) == 1 else f"{len(settings.seeds)} seeds"
    text = f"scale {settings.scale}; {count} ({seeds})"
    if len(settings.irl_seeds) < len(settings.seeds):
        text += f"; new agents share the rewards of {len(settings.irl_seeds)} IRL seeds: intervals are too short"
    return Note("scale", *(scale_notes(settings.scale) or [text]))


def deviation_notes(settings: Settings) -> tuple[Note, ...]:
    """Every setting that differs from the paper's; one remark if none does."""
    notes = tuple(
        Note("deviation", str(found), str(found).removesuffix(f": {found.text}").replace("(paper: ", "("))
        for found in deviations(settings)
    )
    return notes or (Note("remark", "All settings that the paper gives are the paper's"),)


def remarks(texts: Iterable[str]) -> tuple[Note, ...]:
    """Texts as notes of the kind ``remark``."""
    return tuple(Note("remark", text) for text in texts)


def lacks_notes(lacks: Iterable[tuple[str, str]], shown: int = 3) -> tuple[Note, ...]:
    """What unusable runs lack, (folder, what) each; the first ``shown`` in words."""
    found = sorted({(folder, what) for folder, what in lacks if what})
    rest = (f"and {len(found) - shown} more runs: mtcsirl status",) if len(found) > shown else ()
    return tuple(Note("gap", text) for text in (*(f"{folder}: {what}" for folder, what in found[:shown]), *rest))


def left_out(
    what: str, papers: Iterable[str], ours: Iterable[str], label: Callable[[str], str] = lambda name: name
) -> tuple[Note, ...]:
    """A gap that names, by ``label``, which of the ``papers`` rows or columns are not among ``ours``; nothing else."""
    chosen = set(ours)
    missing = [label(name) for name in papers if name not in chosen]
    return (Note("gap", f"not part of this study, {what}: {', '.join(missing)}"),) if missing else ()
