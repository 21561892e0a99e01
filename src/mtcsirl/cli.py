"""The command line ``mtcsirl``: one verb per rule of the DAG, and a few that look at a study from outside.

Heavy modules are imported by the verb that needs them, so that ``--help`` and ``status`` answer at once.
"""

import sys

try:  # Ctrl-C at once is no fault of an import
    import argparse
    import errno
    import gc
    import logging
    import os
    import shlex
    import traceback
    from collections.abc import Sequence
    from typing import NoReturn

    from mtcsirl import __version__
    from mtcsirl.agents import kernels
    from mtcsirl.commands import (
        archive,
        artefacts,
        diagnostics,
        doctor,
        export,
        stages,
        study,
        together,
        validate,
        video,
    )
    from mtcsirl.errors import UserError
    from mtcsirl.extensions import load_from_environment
    from mtcsirl.files import console, stop
    from mtcsirl.worlds.variables import backend
except KeyboardInterrupt:
    sys.exit(130)

THREADS = ("OMP_NUM_THREADS", "MKL_NUM_THREADS", "OPENBLAS_NUM_THREADS")
_WAYS_OUT = {
    errno.ENOSPC: "make room there; the same command goes on from its last checkpoint, if it has one",
    errno.EDQUOT: "make room there; the same command goes on from its last checkpoint, if it has one",
    errno.EACCES: "change its permissions, or write elsewhere",
    errno.EPERM: "change its permissions, or write elsewhere",
    errno.EROFS: "write elsewhere",
}
_NO_MEMORY = (
    "allocate memory",
    "out of memory",
    "memory allocation failed",
    "failed to map segment",
    "bad_alloc",
)


class Parser(argparse.ArgumentParser):
    """An argument parser whose complaint is one line, like every other error of the user."""

    def error(self, message: str) -> NoReturn:
        """Raise what `main` prints."""
        raise UserError(f"{message} (see {self.prog} --help)")


def parser() -> Parser:
    """The parser with all verbs."""
    root = Parser(
        prog="mtcsirl",
        description="Replication of Multi Task Inverse Reinforcement Learning for Common Sense Reward. "
        "`snakemake --cores 2` runs these verbs in the right order; each also works alone.",
    )
    root.add_argument("--version", action="version", version=__version__)
    verbs = root.add_subparsers(metavar="VERB", required=True)
    for group in (stages, together, artefacts, diagnostics, study, archive, doctor, video, export, validate):
        group.register(verbs)
    return root


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one verb.

    Exit code 0; 2 for what a user can mend (one line on stderr); 130 or 143 when stopped; 1 for a bug of this program.
    """
    for name in THREADS:
        os.environ.setdefault(name, "1")
    gc.set_threshold(50_000, 20, 20)  # the collector's passes over what imports leave took a fifth of a job's start-up
    console.protect()
    logging.basicConfig(level=logging.INFO, format="%(asctime)s %(message)s", datefmt="%H:%M:%S", stream=sys.stderr)
    words = ["mtcsirl", *(sys.argv[1:] if arguments is None else arguments)]
    try:
        with stop.heeded():
            kernels.choose(os.environ)
            backend(os.environ)
            load_from_environment()
            parsed = parser().parse_args(arguments)
            with console.logged(words):
                _run(parsed)
    except stop.Stopped as stopped:
        return _say(stopped.line, 128 + stopped.signal)
    except Exception as error:
        signalled = stopped_by(error)
        if signalled is not None:
            return _say(signalled.line, 128 + signalled.signal)
        line = explained(error)
        if line is not None:
            return _say(line, 2)
        traceback.print_exc()
        return _say(f"this is a bug; please report the lines above, version {__version__} and {shlex.join(words)}", 1)
    return 0


def _run(parsed: argparse.Namespace) -> None:
    try:
        parsed.run(parsed)
    except stop.Stopped:
        raise
    except SystemExit as error:
        last = traceback.extract_tb(error.__traceback__)[-1]
        raise UserError(f"{last.filename}:{last.lineno}: ended the job by sys.exit; an extension must not") from error
    if sys.stdout is not None:
        sys.stdout.flush()
    lost = console.lost()
    if lost is not None and parsed.only_prints:
        raise UserError(f"standard output: {lost}; what was printed is not all there")


def stopped_by(error: BaseException | None) -> stop.Stopped | None:
    """The signal that caused an error: a library that is loaded meanwhile makes an ImportError of it."""
    while error is not None and not isinstance(error, stop.Stopped):
        error = error.__cause__
    return error


def explained(error: Exception) -> str | None:
    """The one line for what a user can mend: mistakes, disks, permissions, memory; None for a bug."""
    text = str(error)
    if isinstance(error, UserError):
        return console.plain(text)
    if isinstance(error, MemoryError) or any(words in text.lower() for words in _NO_MEMORY):
        return f"out of memory ({_first_line(text) or 'nothing left'}); give the job more, or choose smaller sizes"
    if isinstance(error, RecursionError):
        return f"something is nested too deeply ({_first_line(text)}); look at the input"
    if isinstance(error, OSError) and error.filename is not None:
        way_out = _WAYS_OUT.get(error.errno or 0)
        return f"{error.filename}: {error.strerror}" + (f"; {way_out}" if way_out else "")
    if isinstance(error, OSError) and error.errno in _WAYS_OUT:
        return f"{error.strerror}; {_WAYS_OUT[error.errno]}"
    return None


def _first_line(text: str) -> str:
    return next((line.strip() for line in text.splitlines() if line.strip()), "")


def _say(line: str, code: int) -> int:
    print(f"mtcsirl: {line}", file=sys.stderr)
    return code


if __name__ == "__main__":
    sys.exit(main())
