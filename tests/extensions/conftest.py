"""Extensions of a test, of which nothing stays behind."""

import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

import mtcsirl.irl.methods  # noqa: F401  as in every command: it brings the probe of methods
from mtcsirl import extensions
from mtcsirl.study.own_files import own_files

REWARD = """from mtcsirl.rewards.ground_truth import COMMON_SENSE_REWARDS, CommonSenseReward, velocity
COMMON_SENSE_REWARDS["{name}"] = CommonSenseReward("{name}", velocity, target={target}, unit="m/s")
"""

Write = Callable[..., Path]


@pytest.fixture
def clean(monkeypatch: pytest.MonkeyPatch) -> Iterator[Callable[[], None]]:
    """Forgets every extension, as a new process has none; the test ends with it."""
    registries = [*extensions._REGISTRIES.values(), extensions.LOADED, sys.modules]
    before = [dict(registry) for registry in registries]
    path = list(sys.path)

    def forget() -> None:
        for registry, entries in zip(registries, before, strict=True):
            for name in registry.keys() - entries.keys():
                del registry[name]
            registry.update(entries)
        sys.path[:] = path
        own_files.cache_clear()

    yield forget
    forget()


@pytest.fixture
def write(tmp_path: Path, clean: Callable[[], None]) -> Write:
    """A file below the test's folder."""

    def written(text: str, name: str = "mine.py") -> Path:
        path = tmp_path / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text, encoding="utf-8")
        return path

    return written
