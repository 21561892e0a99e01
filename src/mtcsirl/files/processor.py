"""Which kernels numpy's OpenBLAS takes: it decides when numpy is loaded, by an environment variable or by itself."""

from pathlib import Path

_NEEDED = {"avx512f", "avx512cd", "avx512bw", "avx512dq", "avx512vl"}
_CPUINFO = Path("/proc/cpuinfo")


def kernels(cpuinfo: str | None = None) -> dict[str, str]:
    """The variables to set before numpy is loaded, given what Linux says of the processor (default: of this one).

    By itself OpenBLAS takes its AVX2 kernels on AMD's processors with AVX-512, at half of their speed.
    """
    if cpuinfo is None:
        cpuinfo = _CPUINFO.read_text(encoding="utf-8", errors="replace") if _CPUINFO.is_file() else ""
    first, _, _ = cpuinfo.partition("\n\n")
    words = {name.strip(): value.split() for name, _, value in (line.partition(":") for line in first.splitlines())}
    if words.get("vendor_id") == ["AuthenticAMD"] and set(words.get("flags", ())) >= _NEEDED:
        return {"OPENBLAS_CORETYPE": "SkylakeX"}
    return {}
