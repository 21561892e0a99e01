"""Runs that are done without having run."""

from dataclasses import replace
from pathlib import Path

from mtcsirl.files import storage
from mtcsirl.files.identity import FILE, Record, checksums, dumps, result_files
from mtcsirl.settings import Settings
from mtcsirl.study.keys import Run, identity_of
from mtcsirl.study.outputs import OUTPUTS


def finish(run: Run, settings: Settings, **other: object) -> None:
    """Leave what a run leaves; ``other``: settings that were other ones when it ran."""
    folder = Path(settings.results) / run.folder
    for name in OUTPUTS[run.stage]:
        storage.write_text(folder / name, "{}")
    storage.write_json(folder / "provenance.json", {"cost": {"cpu_seconds": 3.0}})
    storage.write_json(folder / "gate.json", {"passed": True})
    identity = identity_of(run, settings)
    identity = replace(identity, settings=dict(identity.settings) | other)
    record = Record(identity, checksums(folder, result_files(folder)), {})
    storage.write_text(folder / FILE, dumps(record))
