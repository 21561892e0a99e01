"""Figures 8 and 9 on a machine that cannot render: words in their place, and pictures as soon as it can."""

import subprocess
import sys
from pathlib import Path

import pytest

from mtcsirl.figures.style import caption_of
from mtcsirl.settings.loading import load
from mtcsirl.study.artefacts import artefact_identity
from mtcsirl.study.standing import DONE, STALE
from tests.conftest import CHECKOUT, needs_rendering
from tests.hidden import environment

pytestmark = pytest.mark.slow

SOURCE = CHECKOUT / "src"


def drawn(folder: Path, *, osmesa: bool, **variables: str) -> subprocess.CompletedProcess[str]:
    """``mtcsirl figure 9`` in ``folder``, with OSMesa or without."""
    command = [sys.executable, "-m", "mtcsirl.cli", "figure", "9", "--scale", "smoke"]
    command += ["--set", f"results={folder / 'results'}", "--set", f"figures={folder / 'figures'}"]
    env = environment(folder / "site", SOURCE, osmesa=osmesa) | variables
    return subprocess.run(command, env=env, cwd=CHECKOUT, capture_output=True, text=True, check=False)


def asked(folder: Path, *, osmesa: bool) -> list[str]:
    """State and reasons of figure 9, and the identity of the report, as a process with or without OSMesa sees them."""
    program = (
        "from mtcsirl.settings.loading import load; from mtcsirl.study import artefacts as a\n"
        f"s = load((), ('results={folder / 'results'}', 'figures={folder / 'figures'}'), 'smoke')\n"
        "found = a.artefact_standing('figure_9', s)\n"
        "print(found.state); print('; '.join(found.why)); print(a.artefact_identity('report', s).hash)"
    )
    env = environment(folder / "site", SOURCE, osmesa=osmesa)
    done = subprocess.run([sys.executable, "-c", program], env=env, capture_output=True, text=True, check=True)
    return done.stdout.split("\n")[:3]


def test_without_osmesa_words_stand_in_its_place(tmp_path: Path) -> None:
    done = drawn(tmp_path, osmesa=False)
    assert done.returncode == 0, done.stderr
    assert "apt-get install libosmesa6" in done.stdout
    png = (tmp_path / "figures/figure_9.png").read_bytes()
    assert caption_of(png).startswith("Not rendered on this machine: ")
    assert "apt-get install libosmesa6" in caption_of(png)
    assert (tmp_path / "figures/figure_9.pdf").read_bytes().startswith(b"%PDF")
    assert asked(tmp_path, osmesa=False)[:2] == [DONE, ""]


@needs_rendering
def test_it_is_drawn_as_soon_as_the_machine_can_and_stays_where_it_cannot(tmp_path: Path) -> None:
    assert drawn(tmp_path, osmesa=False).returncode == 0
    report = asked(tmp_path, osmesa=False)[2]
    state, why, other = asked(tmp_path, osmesa=True)
    assert (state, why) == (STALE, "rendered: no -> nothing")
    assert other != report, "the report shows another picture then"
    assert drawn(tmp_path, osmesa=True).returncode == 0
    picture = (tmp_path / "figures/figure_9.png").read_bytes()
    assert "Not rendered" not in caption_of(picture)
    assert asked(tmp_path, osmesa=False)[:2] == asked(tmp_path, osmesa=True)[:2] == [DONE, ""]
    again = drawn(tmp_path, osmesa=False)
    assert again.returncode == 2, "a picture is never replaced by words"
    assert "apt-get install libosmesa6" in again.stderr
    assert (tmp_path / "figures/figure_9.png").read_bytes() == picture


@needs_rendering
def test_a_machine_that_renders_has_the_identity_of_always(monkeypatch: pytest.MonkeyPatch) -> None:
    settings = load(scale="smoke")
    assert "rendered" not in artefact_identity("figure_8", settings).settings
    monkeypatch.setenv("MTCSIRL_NOT_RENDERED", "told so")
    assert artefact_identity("figure_8", settings).settings["rendered"] == "no"
    assert "rendered" not in artefact_identity("figure_1", settings).settings


def test_a_variable_that_names_another_back_end_is_named_in_the_figure(tmp_path: Path) -> None:
    done = drawn(tmp_path, osmesa=True, PYOPENGL_PLATFORM="egl")
    assert done.returncode == 0, done.stderr
    caption = caption_of((tmp_path / "figures/figure_9.png").read_bytes())
    assert "PYOPENGL_PLATFORM=egl: pictures are drawn by osmesa; unset it" in caption
