"""A finished study and its archive."""

from pathlib import Path

import pytest

from tests.results.small_study import STUDY, add, settings, write


@pytest.fixture(scope="session")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A finished study; not to be changed."""
    results = tmp_path_factory.mktemp("made")
    for run in STUDY:
        write(run, settings(results))
    return results


@pytest.fixture(scope="session")
def whole(made: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The archive of that study; not to be changed."""
    folder = tmp_path_factory.mktemp("archive")
    assert add(folder, made) == folder / "part-0001"
    return folder
