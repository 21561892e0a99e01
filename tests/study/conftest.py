"""A study at smoke scale with one seed, in a folder of its own."""

from pathlib import Path

import pytest

from mtcsirl.settings import Settings
from mtcsirl.settings.loading import load


@pytest.fixture
def settings(tmp_path: Path) -> Settings:
    return load((), (f"results={tmp_path / 'results'}", "seeds=[0]", "irl_seeds=[0]"), "smoke")
