"""The arithmetic of another maker's processor, for runs that must have the bytes of runs made there.

Seeds fix everything but the order in which the libraries add. Three choices fix that order, all by the processor:
`agents/products.py` takes numpy on AMD's and torch elsewhere, numpy's OpenBLAS takes kernels by the instructions that
there are, and torch's MKL by maker and instructions. With ``MTCSIRL_KERNELS=amd`` they are those of the processor that
made the evidence archive, on Linux on any x86-64 processor with AVX2.
"""

import ctypes
import mmap
import platform
from collections.abc import Mapping, MutableMapping
from pathlib import Path

from mtcsirl.errors import UserError
from mtcsirl.names import KERNELS

AMD = "amd"
CORE_TYPE = {"OPENBLAS_CORETYPE": "Haswell"}
"""OpenBLAS's kernels with AVX2, which it has for Intel's processors and AMD's alike."""
_MKL_IS_ASKED = {"mkl_serv_intel_cpu": 0, "mkl_serv_intel_cpu_true": 0, "mkl_serv_cpuiszen": 1}
"""Functions by which MKL learns whose processor it runs on, and what they say on AMD's."""
_WRITABLE = mmap.PROT_READ | mmap.PROT_WRITE | mmap.PROT_EXEC


def asked(environment: Mapping[str, str]) -> str:
    """What ``MTCSIRL_KERNELS`` asks for; nothing where it is not set.

    Raises:
        UserError: it has another value, or asks for what this machine cannot do.
    """
    value = environment.get(KERNELS, "")
    if value not in ("", AMD):
        raise UserError(f"{KERNELS}={value}: must be {AMD}, or not be set")
    if value and (platform.system(), platform.machine()) != ("Linux", "x86_64"):
        raise UserError(f"{KERNELS}={value}: needs Linux on an x86-64 processor; unset it")
    return value


def choose(environment: MutableMapping[str, str]) -> None:
    """Make the choices that ``MTCSIRL_KERNELS`` asks for; numpy must not be loaded yet.

    Raises:
        UserError: the variable has another value, or they cannot be made here.
    """
    if not asked(environment):
        return
    environment.update(CORE_TYPE)  # before numpy is loaded, which reads it then

    from mtcsirl.agents import products

    products.BY_NUMPY = True
    _answer_for_amd()


def _answer_for_amd() -> None:
    """Let MKL hear that it runs on a processor of AMD's, before it asks for the first time."""
    import torch

    library = ctypes.CDLL(str(Path(torch.__file__).parent / "lib" / "libtorch_cpu.so"))
    for name, value in _MKL_IS_ASKED.items():
        found = getattr(library, name, None)
        function = ctypes.cast(found, ctypes.c_void_p).value if found else None
        if function is None or not _overwritten(function, value):
            raise UserError(f"{KERNELS}={AMD}: torch {torch.__version__} lets nobody choose its kernels; unset it")


def _overwritten(function: int, value: int) -> bool:
    """Write ``mov eax, value; ret`` over the first bytes of a function in this process's memory."""
    page = function & -mmap.PAGESIZE
    if ctypes.CDLL(None).mprotect(ctypes.c_void_p(page), ctypes.c_size_t(2 * mmap.PAGESIZE), _WRITABLE):
        return False
    ctypes.memmove(function, bytes([0xB8, value, 0, 0, 0, 0xC3]), 6)
    return True
