"""Messages never fail a job, and what earlier tries said stays."""

import subprocess
import sys
from pathlib import Path

import pytest

from tests.faults.command import EXPECTED, environment, in_shell, mtcsirl, one_line, train

pytestmark = pytest.mark.slow

REDIRECTED = {
    "a pipe whose reader is gone": "2>&1 | head -c 1 > /dev/null",
    "closed streams": ">&- 2>&- <&-",
    "a full disk": "> /dev/full 2> /dev/full",
}
"""Training takes seconds after its first message, so the reader is gone before the second."""


@pytest.mark.parametrize("name", REDIRECTED)
def test_a_job_trains_on_whatever_becomes_of_its_messages(tmp_path: Path, name: str) -> None:
    assert in_shell(train(tmp_path / "run", sac__temperature_learning_rate=1e-3), REDIRECTED[name]).returncode == 0
    assert {path.name for path in (tmp_path / "run").iterdir() if path.suffix != ".made"} == EXPECTED


def test_an_unprotected_process_would_fail() -> None:
    """The same redirections, without the protection."""
    chatty = [sys.executable, "-c", "import time\nfor _ in range(20): print('x', flush=True); time.sleep(0.02)"]
    codes = [in_shell(chatty, redirected).returncode for redirected in REDIRECTED.values()]
    assert codes[0] != 0
    assert codes[2] != 0


def test_what_only_prints_says_when_it_could_not(tmp_path: Path) -> None:
    assert "standard output: No space left on device" in one_line(in_shell(mtcsirl("settings", "json"), "> /dev/full"))
    assert in_shell(mtcsirl("settings", "json"), "| head -1 > /dev/null").returncode == 0, "its reader's wish"


def test_letters_that_an_alphabet_lacks_become_others() -> None:
    code = "from mtcsirl.files import console; console.protect(); print('\\u03b1 and \\u20ac')"
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, env=environment(PYTHONIOENCODING="latin-1"), check=True
    )
    assert done.stdout == b"? and ?\n"


def test_a_closed_stream_gives_its_number_to_no_file(tmp_path: Path) -> None:
    code = (
        "import os, sys; from mtcsirl.files import console; console.protect()\n"
        f"handle = open({str(tmp_path / 'data')!r}, 'w'); os.write(1, b'noise'); print('noise'); handle.write('data')"
    )
    in_shell([sys.executable, "-c", code], ">&- 2>&- <&-", check=True)
    assert (tmp_path / "data").read_text() == "data"


SNAKEFILE = """
rule train:
    output: "run/policy.safetensors"
    log: "logs/run.log"
    retries: 1
    params: wrong="" if Path("logs/run.1.log").exists() else "--set sac.discount=2.0"
    shell: "{command} $(test -e logs/run.1.log || echo --set sac.discount=2.0) > {{log:q}} 2>&1"
"""


def test_a_log_stays_though_snakemake_removes_it(tmp_path: Path) -> None:
    (tmp_path / "run.sh").write_text(" ".join(f"'{word}'" for word in train(Path("run"))) + ' "$@"\n')
    (tmp_path / "Snakefile").write_text(SNAKEFILE.format(command="bash run.sh"))
    command = [sys.executable, "-m", "snakemake", "--cores", "1", "--quiet", "all"]
    done = subprocess.run(command[:-1], cwd=tmp_path, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    first, second = (tmp_path / "logs" / name for name in ("run.1.log", "run.log"))
    assert "sac.discount = 2.0" in first.read_text()
    assert "step 600/600" in second.read_text()
    for log in (first, second):
        assert log.read_text().startswith("--- "), "a line that says when and what"
        assert "mtcsirl train-sac --task reach" in log.read_text().splitlines()[0]
    assert sorted(path.name for path in (tmp_path / "logs").iterdir()) == ["run.1.log", "run.log"]
