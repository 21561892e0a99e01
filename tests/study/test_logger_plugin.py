"""Snakemake's messages by ``logger: mtcsirl``, in a file and on a terminal, from real runs of a small workflow."""

import os
import pty
import subprocess
import sys
from pathlib import Path

import pytest

from tests.conftest import CHECKOUT

pytestmark = pytest.mark.slow

SNAKEFILE = """
rule all:
    input: expand("out/{n}/done", n=range(JOBS))
rule job:
    output: "out/{n}/done"
    log: "logs/{n}.log"
    params: settings="s" * 5000
    shell:
        "echo {params.settings:q} > {log:q}; echo nearly there >> {log:q}; test {wildcards.n} != FAILS; touch {output}"
"""
LINES, WIDTH = 150, 200


def command(folder: Path, jobs: int, fails: int | str = "none", *words: str) -> list[str]:
    text = SNAKEFILE.replace("JOBS", str(jobs)).replace("FAILS", str(fails))
    (folder / "Snakefile").write_text(text)
    return [sys.executable, "-m", "snakemake", "--cores", "2", "--show-failed-logs", *words]


def in_a_file(folder: Path, words: list[str]) -> tuple[int, list[str]]:
    env = os.environ | {"PYTHONPATH": str(CHECKOUT / "src")}
    done = subprocess.run(words, cwd=folder, env=env, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
    return done.returncode, done.stdout.splitlines()


def on_a_terminal(folder: Path, words: list[str]) -> str:
    main, side = pty.openpty()
    env = os.environ | {"PYTHONPATH": str(CHECKOUT / "src"), "TERM": "xterm"}
    process = subprocess.Popen(words, cwd=folder, env=env, stdout=side, stderr=side, stdin=subprocess.DEVNULL)
    os.close(side)
    read = b""
    while True:
        try:
            more = os.read(main, 4096)
        except OSError:  # Linux's way to say that nobody holds the other end
            break
        if not more:
            break
        read += more
    os.close(main)
    process.wait()
    return read.decode()


def test_in_a_file_a_job_is_a_line(tmp_path: Path) -> None:
    code, lines = in_a_file(tmp_path, command(tmp_path, 6, "none", "--logger", "mtcsirl"))
    assert code == 0, lines
    assert sum(" job out/" in line for line in lines) == 6
    assert any(line.startswith("7 jobs: 6 job, all") for line in lines)
    assert len(lines) <= 12
    assert max(map(len, lines)) <= WIDTH
    assert len(list((tmp_path / ".snakemake/log").iterdir())) == 1, "the full log stays"
    assert "Traceback" not in "\n".join(lines)


def test_without_it_the_same_run_is_long_and_wide(tmp_path: Path) -> None:
    code, lines = in_a_file(tmp_path, command(tmp_path, 6, 3))
    assert code == 1
    assert len(lines) > 50
    assert max(map(len, lines)) > 5000


def test_a_failure_shows_the_end_of_the_log(tmp_path: Path) -> None:
    code, lines = in_a_file(tmp_path, command(tmp_path, 4, 3, "--logger", "mtcsirl", "--keep-going"))
    assert code == 1
    assert [line for line in lines if line.startswith("failed: job out/3/done; log logs/3.log")]
    assert "    nearly there" in lines
    assert max(map(len, lines)) <= WIDTH
    assert sum(" job out/" in line and not line.startswith("failed") for line in lines) == 3


def test_an_error_of_the_workflow_is_said_whole(tmp_path: Path) -> None:
    (tmp_path / "Snakefile").write_text(f"raise WorkflowError({'wrong ' * 100!r} + 'end')\n")
    code, lines = in_a_file(tmp_path, [sys.executable, "-m", "snakemake", "--cores", "1", "--logger", "mtcsirl"])
    assert code == 1
    assert " ".join(lines).count("wrong") == 100
    assert max(map(len, lines)) <= WIDTH


@pytest.mark.parametrize("words", [("--dry-run",), ("--printshellcmds",)])
def test_a_dry_run_and_printed_commands_keep_snakemakes_form(tmp_path: Path, words: tuple[str, ...]) -> None:
    code, lines = in_a_file(tmp_path, command(tmp_path, 2, "none", "--logger", "mtcsirl", *words))
    assert code == 0
    assert "Job stats:" in lines
    assert "rule job:" in lines or "localrule job:" in lines


def test_on_a_terminal_the_screen_is_redrawn_in_place(tmp_path: Path) -> None:
    text = on_a_terminal(tmp_path, command(tmp_path, 4, "none", "--logger", "mtcsirl"))
    assert "\x1b[" in text
    assert "5 of 5 done" in text
    assert "job 4/4" in text
    assert " job out/" not in text.split("Complete log")[-1]
