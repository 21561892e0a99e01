"""Checkpoints: tensors and notes of a run that can go on, in one safetensors file."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import torch
from torch import Tensor

from mtcsirl.errors import UserError
from mtcsirl.files import storage

_NOTES = "notes"


def save_checkpoint(file: Path, tensors: dict[str, Tensor], notes: dict[str, Any]) -> None:
    """Write both in one file, so that they cannot be of different moments; notes are anything JSON can hold."""
    text = bytearray(json.dumps(notes).encode())
    storage.write_tensors(file, tensors | {_NOTES: torch.frombuffer(text, dtype=torch.uint8)})


def load_checkpoint(file: Path) -> tuple[dict[str, Tensor], dict[str, Any]]:
    """Tensors and notes of a file that `save_checkpoint` wrote.

    Raises UserError when the file is damaged or of another kind.
    """
    tensors = storage.read_tensors(file)
    if _NOTES not in tensors:
        raise UserError(f"{file}: not a checkpoint; delete it to start from the beginning")
    return tensors, json.loads(tensors.pop(_NOTES).numpy().tobytes())


def prefixed(prefix: str, tensors: dict[str, Tensor]) -> dict[str, Tensor]:
    """The same tensors with their names below `prefix`."""
    return {f"{prefix}/{name}": tensor for name, tensor in tensors.items()}


def without_prefix(prefix: str, tensors: dict[str, Tensor]) -> dict[str, Tensor]:
    """The tensors whose names lie below `prefix`, without it."""
    start = f"{prefix}/"
    return {name.removeprefix(start): tensor for name, tensor in tensors.items() if name.startswith(start)}
