"""Products of matrices, network by network, by the library that is the faster one on this processor.

On AMD's processors that is numpy: torch's MKL has AVX2 kernels alone there, numpy's OpenBLAS has AVX-512 too, unless
the variable OPENBLAS_CORETYPE says otherwise. Elsewhere, and on a GPU, it is torch (docs/performance.md has both). The
last bits are the library's and the processor's.
"""

from pathlib import Path

import numpy as np
import torch
from torch import Tensor

ALIGNED = 32
"""Numbers: two of the widest vectors (AVX-512, float32), which torch's loops take at a time."""


def by_numpy(cpuinfo: str) -> bool:
    """Whether numpy is the faster library, by what Linux says of the processor."""
    return "AuthenticAMD" in cpuinfo


_CPUINFO = Path("/proc/cpuinfo")
BY_NUMPY = _CPUINFO.is_file() and by_numpy(_CPUINFO.read_text(encoding="utf-8", errors="replace"))


def slices(like: Tensor, networks: int, rows: int, size: int) -> Tensor:
    """Memory [G, rows, size] whose G slices are contiguous and aligned each."""
    flat = like.new_empty(networks, aligned(rows * size))
    return flat[:, : rows * size].view(networks, rows, size)


def aligned(count: int) -> int:
    """The least multiple of `ALIGNED` that holds `count` numbers."""
    return -(-count // ALIGNED) * ALIGNED


def multiply(left: Tensor, right: Tensor, out: Tensor) -> Tensor:
    """left [G, n, k] right [G, k, m] -> out [G, n, m]."""
    if not (BY_NUMPY and out.is_cpu):
        return torch.bmm(left, right, out=out)
    with np.errstate(over="ignore", invalid="ignore"):  # agents/finite.py looks for what is not finite
        np.matmul(left.numpy(), right.numpy(), out=out.numpy())
    return out


def affine(bias: Tensor, inputs: Tensor, weight: Tensor, out: Tensor) -> None:
    """bias [G, 1, m] + inputs [G, n, k] weight [G, k, m] -> out [G, n, m]."""
    if BY_NUMPY and out.is_cpu:
        multiply(inputs, weight, out).add_(bias)
    elif bias.numel() == 1:
        _column(bias, inputs, weight, out)
    else:
        torch.baddbmm(bias, inputs, weight, out=out)


def _column(bias: Tensor, inputs: Tensor, weight: Tensor, out: Tensor) -> None:
    """bias + inputs weight of one network with one output, as two networks compute it: a lone one takes a kernel of
    torch's of its own, which adds in another order."""
    pair = [tensor.expand(2, -1, -1) for tensor in (bias, inputs, weight)]
    both = slices(out, 2, *out.shape[1:])
    out.copy_(torch.baddbmm(*pair, out=both)[:1])
