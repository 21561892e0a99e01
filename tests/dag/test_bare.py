"""The workflow on a machine without OSMesa ends well, and draws what it can as soon as it can."""

import subprocess
import sys
from pathlib import Path

import pytest

from mtcsirl.figures.style import caption_of
from mtcsirl.settings.loading import load
from mtcsirl.study.design import design
from tests.conftest import needs_rendering
from tests.dag.conftest import SMOKE
from tests.hidden import environment

pytestmark = pytest.mark.dag
DRAWN_FROM_NO_RUN = ("figure_1", "figure_8", "figure_9", "table_5")


def run(workspace: Path, folder: Path, *words: str, osmesa: bool) -> str:
    """Snakemake in a folder of its own; what it said."""
    command = [sys.executable, "-m", "snakemake", "--snakefile", str(workspace / "Snakefile"), "--cores", "2"]
    command += [*DRAWN_FROM_NO_RUN, "--workflow-profile", str(workspace / "profiles/default"), *words]
    command += [SMOKE[0], str(workspace / SMOKE[1])]
    folder.mkdir(exist_ok=True)
    env = environment(folder / "site", workspace / "src", osmesa=osmesa)
    done = subprocess.run(command, cwd=folder, env=env, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout + done.stderr


@needs_rendering
def test_words_first_and_pictures_when_the_machine_can(workspace: Path, tmp_path: Path) -> None:
    folder = tmp_path / "study"
    said = run(workspace, folder, osmesa=False)
    assert f"results/smoke: of {len(list(design(load(scale='smoke'))))} runs 0 done" in said
    png = folder / "paper_figs/smoke/figure_8.png"
    assert caption_of(png.read_bytes()).startswith("Not rendered on this machine: ")
    assert "Nothing to be done" in run(workspace, folder, osmesa=False)
    assert {line.split()[0] for line in run(workspace, folder, "-n", osmesa=True).splitlines() if line} & set(
        DRAWN_FROM_NO_RUN
    ) == {"figure_8", "figure_9"}
    run(workspace, folder, osmesa=True)
    assert "Not rendered" not in caption_of(png.read_bytes())
    assert "Nothing to be done" in run(workspace, folder, osmesa=False), "a picture stays"
