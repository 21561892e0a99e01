"""Snakemake with its libraries loaded: each command is done by a fork of this process, which saves half of its time.

The process has loaded nothing of this package, so that every command reads the sources as they stand, edited or not.
Where nothing is edited it may have the package loaded too, with the code of all stages and pages hashed.
"""

import json
import os
import subprocess
import sys
import traceback
from collections.abc import Sequence
from pathlib import Path
from typing import NoReturn


class Loaded:
    """Such a process, for commands that find the package in ``sources``; what they print passes by files ``said``."""

    def __init__(self, sources: Path, said: Path, *, package: bool = False) -> None:
        self._said = said
        environment = os.environ | {"PYTHONPATH": str(sources), "PYTHONDONTWRITEBYTECODE": "1"}
        command = [sys.executable, __file__, *["package"][: int(package)]]
        self._process = subprocess.Popen(
            command, env=environment, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
        )

    def snakemake(self, words: Sequence[str], cwd: Path) -> subprocess.CompletedProcess[str]:
        """``python -m snakemake`` with ``words`` in ``cwd``."""
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        out, err = self._said.with_suffix(".out"), self._said.with_suffix(".err")
        self._process.stdin.write(json.dumps([list(words), *map(str, (cwd, out, err))]) + "\n")
        self._process.stdin.flush()
        code = int(self._process.stdout.readline())
        return subprocess.CompletedProcess(list(words), code, out.read_text(), err.read_text())

    def __enter__(self) -> "Loaded":
        return self

    def __exit__(self, *error: object) -> None:
        self._process.communicate()


def _serve() -> None:
    """Do what stands in each line of standard input, and answer with its exit code."""
    import numpy  # noqa: F401
    import pydantic  # noqa: F401
    import snakemake.cli
    import snakemake.report
    import snakemake.scheduling.job_scheduler  # noqa: F401

    assert not [name for name in sys.modules if "mtcsirl" in name], "the package is loaded by each command"
    if sys.argv[1:] == ["package"]:
        _load_the_package()
    for line in sys.stdin:
        child = os.fork()
        if not child:
            _do(*json.loads(line))
        print(os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]), flush=True)


def _load_the_package() -> None:
    from mtcsirl.settings.loading import load
    from mtcsirl.study import status  # noqa: F401
    from mtcsirl.study.artefacts import artefact_identity

    artefact_identity("report", load(scale="smoke"))


def _do(words: list[str], cwd: str, out: str, err: str) -> NoReturn:
    """One command in a fork, which ends with it."""
    code = 1
    try:
        for number, path in ((0, os.devnull), (1, out), (2, err)):
            os.dup2(os.open(path, os.O_RDWR | os.O_CREAT | os.O_TRUNC), number)
        os.chdir(cwd)
        sys.path[0], sys.argv = cwd, ["snakemake", *words]
        from snakemake.cli import main

        main(words)
    except SystemExit as ended:
        code = ended.code if isinstance(ended.code, int) else int(ended.code is not None)
        if isinstance(ended.code, str):
            print(ended.code, file=sys.stderr)
    except BaseException:
        traceback.print_exc()
    finally:
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(code)


if __name__ == "__main__":
    _serve()
