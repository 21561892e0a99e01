"""From a number on the page to the runs that it was made from: each set of runs is one entry, with its own address."""

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from itertools import chain, groupby
from pathlib import PurePosixPath

from mtcsirl.report.content import ReportData

Folders = tuple[str, ...]


@dataclass(frozen=True)
class Entry:
    """One set of runs. ``groups``: the folder above some of them, and each one's name with the address of its rows."""

    anchor: str
    runs: int
    groups: tuple[tuple[str, tuple[tuple[str, str], ...]], ...]

    @property
    def summary(self) -> str:
        """What they have in common."""
        parents = [parent for parent, _ in self.groups]
        return parents[0] if len(parents) == 1 else f"{parents[0]} and {len(parents) - 1} more"

    @property
    def patterns(self) -> list[str]:
        """The folders as bash expands them: ``sac/reach-t0/s{0,1}``."""
        return [_pattern(parent, [name for name, _ in names]) for parent, names in self.groups]


def _pattern(parent: str, names: list[str]) -> str:
    if len(names) == 1:
        return f"{parent}/{names[0]}"
    if all(name.startswith("s") for name in names):
        return f"{parent}/s{{{','.join(name[1:] for name in names)}}}"
    return f"{parent}/{{{','.join(names)}}}"


def entries(data: ReportData) -> dict[Folders, Entry]:
    """Every set of runs behind a number of the page, in the order in which the page has them."""
    found = dict.fromkeys(folders for folders in _sets(data) if folders)
    return {folders: _entry(f"rows-{number}", folders, data.rows) for number, folders in enumerate(found, start=1)}


def _sets(data: ReportData) -> Iterator[Folders]:
    for view in data.tables:
        yield from chain.from_iterable(line.folders.values() for line in view.table.lines)
    for claim in data.claims:
        yield from (unit.folders for unit in claim.units)
    yield from (line.folders for line in data.gates)


def _entry(anchor: str, folders: Iterable[str], rows: Mapping[str, str]) -> Entry:
    paths = sorted(map(PurePosixPath, folders))
    groups = [(parent, list(group)) for parent, group in groupby(paths, key=lambda path: path.parent.as_posix())]
    named = [(parent, tuple((path.name, rows.get(path.as_posix(), "")) for path in group)) for parent, group in groups]
    return Entry(anchor, len(paths), tuple(named))
