#!/usr/bin/env python
"""mtcsirl with the arithmetic of the archive's processor, an AMD EPYC, on other x86-64 processors (docs/archive.md).

Use: python examples/archive_kernels.py VERB ..., or linked as `mtcsirl` on the PATH of snakemake.
Products are numpy's, OpenBLAS takes its AVX2 kernels, and torch's MKL those that it has for AMD's processors.
"""

import ctypes
import mmap
import os
import sys
from pathlib import Path

os.environ["OPENBLAS_CORETYPE"] = "Haswell"  # OpenBLAS and MKL read the environment when they are loaded
os.environ |= dict.fromkeys(("OMP_NUM_THREADS", "MKL_NUM_THREADS", "OPENBLAS_NUM_THREADS"), "1")

import torch

from mtcsirl.agents import products
from mtcsirl.cli import main

ANSWERS = {"mkl_serv_intel_cpu": 0, "mkl_serv_intel_cpu_true": 0, "mkl_serv_cpuiszen": 1}
WRITABLE = mmap.PROT_READ | mmap.PROT_WRITE | mmap.PROT_EXEC


def answer(function: int, value: int) -> None:
    """Write `mov eax, value; ret` over the first bytes of a function."""
    page = function & -mmap.PAGESIZE
    if ctypes.CDLL(None).mprotect(ctypes.c_void_p(page), ctypes.c_size_t(2 * mmap.PAGESIZE), WRITABLE):
        sys.exit("archive_kernels: this system lets no program change its own code")
    ctypes.memmove(function, bytes([0xB8, value, 0, 0, 0, 0xC3]), 6)


if __name__ == "__main__":
    library = ctypes.CDLL(str(Path(torch.__file__).parent / "lib" / "libtorch_cpu.so"))
    for name, value in ANSWERS.items():
        answer(ctypes.cast(getattr(library, name), ctypes.c_void_p).value or 0, value)
    products.BY_NUMPY = True
    sys.exit(main())
