"""The command line ``mtcsirl``: one verb per rule of the DAG, and a few that look at a study from outside.

Heavy modules are imported by the verb that needs them, so that ``--help`` and ``status`` answer at once.
"""

import argparse
import logging
import os
import signal
import sys
from collections.abc import Sequence
from types import FrameType
from typing import NoReturn

from mtcsirl import __version__
from mtcsirl.commands import artefacts, diagnostics, export, stages, study, together, validate, video
from mtcsirl.errors import UserError
from mtcsirl.extensions import load_from_environment
from mtcsirl.worlds.variables import backend

THREADS = ("OMP_NUM_THREADS", "MKL_NUM_THREADS", "OPENBLAS_NUM_THREADS")


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
    for group in (stages, together, artefacts, diagnostics, study, video, export, validate):
        group.register(verbs)
    return root


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one verb; exit code 0, 2 for a mistake of the user (one line on stderr), 130 or 143 when stopped."""
    for name in THREADS:
        os.environ.setdefault(name, "1")
    logging.basicConfig(level=logging.INFO, format="%(asctime)s %(message)s", datefmt="%H:%M:%S", stream=sys.stderr)
    signal.signal(signal.SIGTERM, _stop)
    try:
        backend(os.environ)
        load_from_environment()
        parsed = parser().parse_args(arguments)
        parsed.run(parsed)
        sys.stdout.flush()
    except UserError as error:
        print(f"mtcsirl: {error}", file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        print("mtcsirl: interrupted; the same command goes on from the last checkpoint", file=sys.stderr)
        return 130
    except BrokenPipeError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    return 0


def _stop(number: int, frame: FrameType | None) -> None:
    """End like an error would, so that temporary files go and locks open."""
    raise SystemExit(128 + number)


if __name__ == "__main__":
    sys.exit(main())
