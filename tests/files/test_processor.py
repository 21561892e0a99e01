"""AVX-512 is asked for where OpenBLAS would not take it by itself, and only where the processor has it."""

import pytest

from mtcsirl.files.processor import kernels

AVX_512 = "avx2 avx512f avx512dq avx512cd avx512bw avx512vl"


def cpuinfo(vendor: str, flags: str) -> str:
    one = f"processor\t: 0\nvendor_id\t: {vendor}\nmodel name\t: a: b\nflags\t\t: fpu {flags}\n"
    return f"{one}\n{one}"


@pytest.mark.parametrize(
    ("vendor", "flags", "found"),
    [
        ("AuthenticAMD", AVX_512, {"OPENBLAS_CORETYPE": "SkylakeX"}),
        ("AuthenticAMD", "avx2 avx512f", {}),
        ("AuthenticAMD", "avx2", {}),
        ("GenuineIntel", AVX_512, {}),
    ],
)
def test_by_maker_and_instructions(vendor: str, flags: str, found: dict[str, str]) -> None:
    assert kernels(cpuinfo(vendor, flags)) == found


def test_a_machine_that_says_nothing_of_its_processor() -> None:
    assert kernels("") == {}
