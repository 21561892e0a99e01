"""Files that a user wrote or named: what is wrong with one is said with how to mend it, never to make it again."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from mtcsirl.errors import UserError
from mtcsirl.files import storage

_REMEDY = "; delete it and make it again"
"""What a reader says of a file that a run left."""


def read_given(path: Path | str) -> str:
    """The text of a file.

    Raises:
        UserError: it is missing, no file, not to be read, or not in UTF-8.
    """
    check_given(path)
    with as_given("change its permissions, or name another"):
        content = storage.read_bytes(path)
    try:
        return content.decode("utf-8")
    except UnicodeDecodeError as error:
        line = content.count(b"\n", 0, error.start) + 1
        raise UserError(f"{path}: not UTF-8 (line {line}); save it in that encoding") from error


def check_given(path: Path | str, *, missing: str = "check its name") -> None:
    """Raise UserError where ``path`` is no file; ``missing``: the way out where nothing is there."""
    path = Path(path)
    if path.is_dir():
        raise UserError(f"{path}: is a folder; name a file")
    if path.exists() and not path.is_file():
        raise UserError(f"{path}: is a device or a pipe; name a file")
    if not path.exists():
        raise UserError(f"{path}: no such file; {missing}")


@contextmanager
def as_given(way_out: str) -> Iterator[None]:
    """A block that reads a file which a user named: where it would be deleted and made again, ``way_out`` is said."""
    try:
        yield
    except UserError as error:
        said = str(error)
        if not said.endswith(_REMEDY):
            raise
        raise UserError(f"{said.removesuffix(_REMEDY)}; {way_out}") from error
