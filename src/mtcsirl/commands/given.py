"""What can stand on a command line once: options, and one source of the settings."""

import argparse
from collections.abc import Sequence
from typing import Any

from mtcsirl.errors import UserError
from mtcsirl.settings.loading import read_yaml
from mtcsirl.settings.strict import StrictError, parse_json


class Once(argparse.Action):
    """Store a value as argparse does, which takes the last of two without a word; here the second is an error."""

    def __call__(
        self,
        parser: argparse.ArgumentParser,
        namespace: argparse.Namespace,
        values: str | Sequence[Any] | None,
        option_string: str | None = None,
    ) -> None:
        """Store ``values``; raises argparse.ArgumentError, which names the option."""
        stored = namespace.__dict__.setdefault("stored", set())
        if option_string and self.dest in stored:
            several = ", with all values behind it" if self.nargs else ""
            raise argparse.ArgumentError(self, f"given twice; give it once{several}")
        stored.add(self.dest)
        setattr(namespace, self.dest, values)


def settings_given(parsed: argparse.Namespace) -> tuple[str, dict[str, Any]]:
    """What ``--settings`` holds, JSON or the file of that name, after the name of either.

    Raises:
        UserError: ``--scale`` or ``--config`` stand beside it, of which nothing would be read.
    """
    scale = [f"--scale {parsed.scale}"] if parsed.scale else []
    beside = [*scale, *(f"--config {file}" for file in parsed.config)]
    if beside:
        raise UserError(
            f"--settings and {' and '.join(beside)}: --settings takes the place of a configuration; give one of them,"
            " and single keys by --set"
        )
    text: str = parsed.settings
    if not text.lstrip().startswith("{"):
        return text, read_yaml(text)
    try:
        data: dict[str, Any] = parse_json(text)
    except StrictError as error:
        raise UserError(f"--settings: {error}") from error
    return "--settings", data
