"""The only module that touches files: atomic writers and readers that never unpickle.

Every writer writes a temporary file in the same folder, flushes it to disk and renames it into place, so a crash or a
full disk leaves the old file or none, never half of one. Every reader turns a missing, truncated or foreign file into
one :class:`~mtcsirl.errors.UserError` that names it.
"""

import hashlib
import json
import os
import tempfile
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import IO, TYPE_CHECKING, Any, TypeVar

from mtcsirl.errors import UserError
from mtcsirl.files.identity import verify, why_absent
from mtcsirl.files.lock import is_locked as is_locked
from mtcsirl.files.lock import locked as locked

if TYPE_CHECKING:
    import pandas as pd
    import torch

Parsed = TypeVar("Parsed")


@contextmanager
def atomic(path: Path | str, mode: str = "w") -> Iterator[IO[Any]]:
    """Open a temporary neighbour of ``path`` and rename it to ``path`` when the block ends without an error.

    Raises OSError that names ``path`` when it cannot be written, for example on a full disk.
    """
    path = Path(path)
    temporary = path.with_name(f".{path.name}.{os.getpid()}.tmp")
    text = "b" not in mode
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with open(temporary, mode, encoding="utf-8" if text else None, newline="" if text else None) as handle:
            yield handle
            handle.flush()
            os.fsync(handle.fileno())
        os.replace(temporary, path)
    except OSError as error:
        if error.errno is None or error.filename not in (None, str(temporary)):
            raise
        raise OSError(error.errno, os.strerror(error.errno), str(path)) from error
    finally:
        with suppress(OSError):
            temporary.unlink()


def _read(path: Path | str, parse: Callable[[Path], Parsed], what: str) -> Parsed:
    path = Path(path)
    if not path.is_file():
        raise UserError(f"{path}: {why_absent(path)}")
    verify(path)
    try:
        return parse(path)
    except UserError:
        raise
    except Exception as error:
        line = str(error).strip().splitlines()[0] if str(error).strip() else type(error).__name__
        raise UserError(f"{path}: not a readable {what} ({line}); delete it and make it again") from error


def write_text(path: Path | str, text: str) -> None:
    """Write a text file."""
    with atomic(path) as handle:
        handle.write(text)


def write_bytes(path: Path | str, data: bytes) -> None:
    """Write a binary file."""
    with atomic(path, "wb") as handle:
        handle.write(data)


def restore(path: Path | str, data: bytes) -> None:
    """Write a file whose reader knows its checksum and refuses half of it: not atomic, and not flushed to disk."""
    path = Path(path)
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(data)


def read_text(path: Path | str) -> str:
    """Read a text file."""
    return _read(path, lambda p: p.read_text(encoding="utf-8"), "text file")


def read_bytes(path: Path | str) -> bytes:
    """Read a binary file."""
    return _read(path, lambda p: p.read_bytes(), "file")


def write_json(path: Path | str, data: Any) -> None:
    """Write JSON with sorted keys, so equal data gives equal bytes."""
    write_text(path, json.dumps(data, indent=2, sort_keys=True, allow_nan=False) + "\n")


def read_json(path: Path | str) -> Any:
    """Read JSON."""
    return _read(path, lambda p: json.loads(p.read_text(encoding="utf-8")), "JSON file")


def write_csv(path: Path | str, frame: "pd.DataFrame") -> None:
    """Write a tidy frame; floats with 9 significant digits, enough for float32."""
    with atomic(path) as handle:
        render_csv(handle, frame)


def render_csv(handle: IO[str], frame: "pd.DataFrame") -> None:
    """Write a tidy frame into an open text file."""
    frame.to_csv(handle, index=False, float_format="%.9g", lineterminator="\n")


_NUMBERS = {"target", "seed", "episode", "step", "value", "low", "high", "n", "episodes"}
"""Columns of tidy frames that hold numbers."""


def read_csv(path: Path | str, columns: tuple[str, ...] = ()) -> "pd.DataFrame":
    """Read a tidy frame and check that ``columns`` are there; empty cells of text columns stay empty strings.

    A text in a column of numbers is an error that names both; an empty cell there is NaN.
    """
    import pandas as pd

    names = ("task", "cs_reward", "method", "source", "experiment", "policy", "metric", "discriminator")
    text = dict.fromkeys(names, str)

    def parse(p: Path) -> "pd.DataFrame":
        return pd.read_csv(p, dtype=text, keep_default_na=True).fillna(dict.fromkeys(text, ""))

    frame = _with_columns(path, _read(path, parse, "CSV file"), columns)
    for name in _NUMBERS & set(frame.columns):
        if not pd.api.types.is_numeric_dtype(frame[name]):
            texts = frame[name][pd.to_numeric(frame[name], errors="coerce").isna() & frame[name].notna()]
            if len(texts):
                raise UserError(f"{path}: column {name} holds {str(texts.iloc[0])[:40]!r}, not a number; make it again")
    return frame


def write_parquet(path: Path | str, frame: "pd.DataFrame", level: int | None = None) -> None:
    """Write a frame as Parquet (zstd, at the library's level or ``level``)."""
    with atomic(path, "wb") as handle:
        frame.to_parquet(handle, index=False, compression="zstd", compression_level=level)


def read_parquet(path: Path | str, columns: tuple[str, ...] = ()) -> "pd.DataFrame":
    """Read a Parquet frame, of it ``columns`` alone where named, and check that they are there."""
    import pandas as pd
    from pyarrow.parquet import read_schema

    def parse(p: Path) -> "pd.DataFrame":
        present = [name for name in read_schema(p).names if name in columns] if columns else None
        return pd.read_parquet(p, columns=present)

    return _with_columns(path, _read(path, parse, "Parquet file"), columns)


def _with_columns(path: Path | str, frame: "pd.DataFrame", columns: tuple[str, ...]) -> "pd.DataFrame":
    missing = [name for name in columns if name not in frame.columns]
    if missing:
        raise UserError(f"{path}: lacks the column {', '.join(missing)}; delete it and make it again")
    return frame


def write_tensors(path: Path | str, tensors: Mapping[str, "torch.Tensor"]) -> None:
    """Write named tensors as safetensors."""
    from safetensors.torch import save

    data = save({name: tensor.detach().cpu().contiguous().clone() for name, tensor in tensors.items()})
    write_bytes(path, data)


def read_tensors(path: Path | str) -> "dict[str, torch.Tensor]":
    """Read named tensors from safetensors; no code in the file can run."""
    from safetensors.torch import load

    return _read(path, lambda p: load(p.read_bytes()), "safetensors file")


def checksum(path: Path | str) -> str:
    """SHA-256 of a file."""

    def parse(p: Path) -> str:
        with open(p, "rb") as handle:
            return hashlib.file_digest(handle, "sha256").hexdigest()

    return _read(path, parse, "file")


def remove(path: Path | str) -> None:
    """Delete a file if it is there."""
    Path(path).unlink(missing_ok=True)


def check_writable(path: Path | str, *, folder: bool) -> None:
    """Find out before any work whether a folder, or else a file, can be written at ``path``. Leaves nothing.

    Raises:
        UserError: something else is there, or what it would be in cannot be written or is full.
    """
    path = Path(path)
    if path.exists() and not (path.is_dir() or path.is_file()):
        raise UserError(f"{path}: is neither a file nor a folder; choose another name")
    if path.exists() and path.is_dir() != folder:
        raise UserError(f"{path}: is a file; name a folder" if folder else f"{path}: is a folder; name a file")
    place = next(one for one in (path, *path.absolute().parents) if one.exists())
    place = place.parent if not folder and place == path else place
    if not place.is_dir():
        raise UserError(f"{place}: is a file, so that {path} cannot be made; write elsewhere")
    try:
        with tempfile.TemporaryFile(dir=place) as probe:
            probe.write(b"\0" * 4096)
            probe.flush()
    except OSError as error:
        raise UserError(
            f"{place}: cannot be written ({error.strerror}); make room there, or write elsewhere"
        ) from error


def append_line(path: Path | str, line: str) -> None:
    """Append one line to a log that may be cut off anywhere."""
    path = Path(path)
    path.parent.mkdir(parents=True, exist_ok=True)
    with open(path, "a", encoding="utf-8") as handle:
        handle.write(line.rstrip("\n") + "\n")
