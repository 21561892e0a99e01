"""`make reference` gives the committed tables, figures, verdicts and report from the committed archive, to the byte."""

import shutil
import subprocess

import pytest

from mtcsirl.results.archive import parts, verify
from tests.conftest import CHECKOUT

REFERENCE = CHECKOUT / "results" / "reference"
MOST = 60 * 2**20
committed = pytest.mark.skipif(not parts(REFERENCE), reason="results/reference holds no part yet")


@committed
def test_the_committed_archive_is_sound_and_small():
    assert verify(REFERENCE) == []
    assert sum(path.stat().st_size for path in REFERENCE.rglob("*") if path.is_file()) <= MOST


@committed
@pytest.mark.slow
@pytest.mark.skipif(shutil.which("make") is None, reason="needs make")
def test_make_reference_gives_what_is_committed(tmp_path):
    words = ["make", "--old-file=setup", "reference", f"REFERENCE={tmp_path}"]
    done = subprocess.run(words, cwd=CHECKOUT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr[-2000:]
