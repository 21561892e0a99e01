"""Without the extras the tests of what they are for are skipped, and none is red."""

import subprocess
import sys
from pathlib import Path

import pytest

pytestmark = pytest.mark.slow

EXTRAS = {"tensorboard": "tests/agents/test_training.py", "minari": "tests/exports/test_minari.py"}
HIDE = """
import importlib.abc, sys
class Hidden(importlib.abc.MetaPathFinder):
    def find_spec(self, name, path=None, target=None):
        if name.partition(".")[0] == {name!r}:
            raise ModuleNotFoundError(f"No module named {{name!r}}", name=name)
sys.meta_path.insert(0, Hidden())
import pytest
sys.exit(pytest.main(["-q", "-rs", "-p", "no:cacheprovider", *sys.argv[1:]]))
"""


@pytest.mark.parametrize("name", EXTRAS)
def test_an_extra_that_is_not_installed_makes_no_test_red(name: str, checkout: Path) -> None:
    only = ["-k", "events"] if name == "tensorboard" else []
    command = [sys.executable, "-c", HIDE.format(name=name), EXTRAS[name], *only]
    done = subprocess.run(command, cwd=checkout, capture_output=True, text=True, check=False)
    assert done.returncode in (0, 5), done.stdout
    assert f"pip install 'mtcsirl[{'export' if name == 'minari' else name}]'" in done.stdout
