"""Checkpoints: tensors and notes of a run that can go on, in one safetensors file that proves itself.

The header names the run that wrote it; the last tensor, ``sha256``, is the checksum of every byte before it. Both
directions go through the file in pieces, so that saving a run needs no second copy of it in memory.
"""

from __future__ import annotations

import hashlib
import json
import logging
import math
import os
from collections.abc import Iterator
from itertools import chain
from pathlib import Path
from typing import IO, Any

import torch
from torch import Tensor

from mtcsirl.files.storage import atomic

Checkpoint = tuple[dict[str, Tensor], dict[str, Any]]
"""Named tensors, and notes of anything that JSON can hold."""

_NOTES, _RUN, _SUM = "notes", "run", "sha256"
_PIECE = 1 << 22
"""Elements, or bytes, that are handled at a time."""
_LENGTH = 8
"""Bytes of the number at the start of a safetensors file, which is the length of its header."""
_MOST_HEADER = 100_000_000
_DTYPES = {
    "F64": torch.float64,
    "I64": torch.int64,
    "F32": torch.float32,
    "I32": torch.int32,
    "F16": torch.float16,
    "BF16": torch.bfloat16,
    "I16": torch.int16,
    "I8": torch.int8,
    "U8": torch.uint8,
    "BOOL": torch.bool,
}
_NAMES = {dtype: name for name, dtype in _DTYPES.items()}
_LOG = logging.getLogger(__name__)


class DamagedError(Exception):
    """What is wrong with a checkpoint's file."""


def save_checkpoint(file: Path | str, tensors: dict[str, Tensor], notes: dict[str, Any], *, run: str) -> None:
    """Write both in one file, so that they cannot be of different moments.

    run: identity of the run (its settings, inputs and code): a checkpoint of another one is not taken up.
    """
    text = torch.frombuffer(bytearray(json.dumps(notes).encode()), dtype=torch.uint8)
    ordered = sorted((tensors | {_NOTES: text}).items(), key=lambda item: (-item[1].element_size(), item[0]))
    ordered.append((_SUM, torch.empty(hashlib.sha256().digest_size, dtype=torch.uint8)))
    digest = hashlib.sha256()
    with atomic(file, "wb") as handle:
        for piece in chain([_head(ordered, run)], *(_pieces(tensor) for _, tensor in ordered[:-1])):
            handle.write(piece)
            digest.update(piece)
        handle.write(digest.digest())


def load_checkpoint(file: Path | str, *, run: str) -> Checkpoint | None:
    """Tensors and notes that `save_checkpoint` wrote for this run.

    None where there is no file, and, with one line in the log, where it is damaged or of another run.
    """
    file = Path(file)
    if not file.is_file():
        return None
    try:
        return _load(file, run)
    except DamagedError as error:
        _LOG.warning("%s: %s; starting from the beginning", file, error)
    except (OSError, ValueError, KeyError, TypeError, RecursionError) as error:
        reason = str(error).strip() or type(error).__name__
        _LOG.warning("%s: damaged (%s); starting from the beginning", file, reason.splitlines()[0])
    return None


def prefixed(prefix: str, tensors: dict[str, Tensor]) -> dict[str, Tensor]:
    """The same tensors with their names below `prefix`."""
    return {f"{prefix}/{name}": tensor for name, tensor in tensors.items()}


def without_prefix(prefix: str, tensors: dict[str, Tensor]) -> dict[str, Tensor]:
    """The tensors whose names lie below `prefix`, without it."""
    start = f"{prefix}/"
    return {name.removeprefix(start): tensor for name, tensor in tensors.items() if name.startswith(start)}


def _head(ordered: list[tuple[str, Tensor]], run: str) -> memoryview:
    """Length and header of a safetensors file, the header filled up with blanks to a multiple of 8 bytes."""
    entries: dict[str, Any] = {"__metadata__": {_RUN: run}}
    end = 0
    for name, tensor in ordered:
        start, end = end, end + tensor.numel() * tensor.element_size()
        entries[name] = {"dtype": _NAMES[tensor.dtype], "shape": list(tensor.shape), "data_offsets": [start, end]}
    text = json.dumps(entries).encode()
    text += b" " * (-len(text) % _LENGTH)
    return memoryview(len(text).to_bytes(_LENGTH, "little") + text)


def _pieces(tensor: Tensor) -> Iterator[memoryview]:
    """The bytes of a tensor in order; only a piece of it is ever copied."""
    if not tensor.is_contiguous() and tensor.numel() > _PIECE:
        for part in tensor.detach():
            yield from _pieces(part)
    elif tensor.numel():
        for part in tensor.detach().contiguous().view(-1).split(_PIECE):
            yield memoryview(part.cpu().view(torch.uint8).numpy())


def _load(file: Path, run: str) -> Checkpoint:
    with open(file, "rb") as handle:
        size = os.fstat(handle.fileno()).st_size
        _verify(handle, size)
        length = int.from_bytes(handle.read(_LENGTH), "little")
        if length > min(size, _MOST_HEADER):
            raise DamagedError("damaged (a header longer than the file)")
        entries = json.loads(handle.read(length))
        if entries.pop("__metadata__")[_RUN] != run:
            raise DamagedError("of a run with other settings, inputs or code")
        tensors = {name: _read(handle, entry, size) for name, entry in _in_order(entries) if name != _SUM}
    return tensors, json.loads(tensors.pop(_NOTES).numpy().tobytes())


def _verify(handle: IO[bytes], size: int) -> None:
    """Compare the checksum at the end with the bytes before it; leaves the file at its start."""
    digest = hashlib.sha256()
    left = size - digest.digest_size
    while left > 0:
        piece = handle.read(min(left, _PIECE))
        if not piece:
            break
        digest.update(piece)
        left -= len(piece)
    if left or handle.read() != digest.digest():
        raise DamagedError("damaged, or of an older version")
    handle.seek(0)


def _in_order(entries: dict[str, Any]) -> list[tuple[str, Any]]:
    return sorted(entries.items(), key=lambda item: item[1]["data_offsets"][0])


def _read(handle: IO[bytes], entry: dict[str, Any], size: int) -> Tensor:
    """The tensor that an entry of the header describes; they lie in the file one after another."""
    dtype, shape = _DTYPES[entry["dtype"]], [int(length) for length in entry["shape"]]
    start, end = entry["data_offsets"]
    if min(shape, default=0) < 0 or math.prod(shape) * dtype.itemsize != end - start or end > size:
        raise DamagedError("damaged (a tensor of another size than its header says)")
    tensor = torch.empty(shape, dtype=dtype)
    if tensor.numel() and handle.readinto(tensor.view(-1).view(torch.uint8).numpy()) != end - start:  # type: ignore[attr-defined]
        raise DamagedError("damaged (it ends too early)")
    return tensor
