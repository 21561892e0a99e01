"""The command that makes what a verb misses, with the configuration it was given: it runs as it is printed."""

import argparse
import json
import os
import shlex
from collections.abc import Callable
from pathlib import Path
from typing import Any

from mtcsirl.errors import MissingError, UserError
from mtcsirl.settings.loading import CONFIG, override

Verb = Callable[[argparse.Namespace], None]


def advised(run: Verb, target: Callable[[argparse.Namespace], str]) -> Verb:
    """``run`` whose complaint about something missing says how to make the ``target`` of its arguments."""

    def advising(parsed: argparse.Namespace) -> None:
        try:
            run(parsed)
        except MissingError as error:
            command = snakemake_command(parsed, target(parsed))
            raise UserError(f"{error}; make it with `{command}`, or ask for --partial results") from error

    return advising


def snakemake_command(parsed: argparse.Namespace, target: str) -> str:
    """The call of Snakemake for ``target`` with the configuration of ``--scale``, ``--config`` and ``--set``."""
    words = ["snakemake", "--cores", "2"]
    if not Path("Snakefile").is_file():
        words += ["--snakefile", str(CONFIG.parent / "Snakefile")]
    words.append(target)
    files = [_shown(CONFIG / f"{parsed.scale}.yaml")] if parsed.scale not in (None, "desk") else []
    files += parsed.config
    values = override({}, parsed.set)
    if parsed.settings and parsed.settings.lstrip().startswith("{"):
        return f"{shlex.join(words)} with the configuration of --settings"
    if parsed.settings:
        files = [parsed.settings]
    if files:
        words += ["--configfile", *files]
    if values:
        words += ["--config", *(f"{name}={_flow(value)}" for name, value in values.items())]
    return shlex.join(words)


def _shown(file: Path) -> str:
    near = os.path.relpath(file)
    return str(file) if near.startswith("..") else near


def _flow(value: Any) -> str:
    return value if isinstance(value, str) else json.dumps(value, ensure_ascii=False)
