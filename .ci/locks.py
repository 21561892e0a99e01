"""constraints.txt from requirements.lock: the same versions without hashes, for `make constraints`.

usage: locks.py LOCK. In the lock alone is what differs by platform: the CUDA libraries of torch, and pip's own tools.
"""

import re
import sys
from pathlib import Path

HEAD = "# Exact versions of every dependency, from `make constraints`; requirements.lock has the same with checksums."
_PIN = re.compile(r"^([a-z0-9.-]+)==([^ ;\\]+)", re.MULTILINE)
_OF_A_PLATFORM = re.compile(r"nvidia-|cuda-|triton$|pip$|setuptools$")


def pins(lock: str) -> dict[str, str]:
    """Name -> version of every package of a lock but those of a platform.

    Raises ValueError where a package has two versions: constraints have room for one.
    """
    found: dict[str, str] = {}
    for name, version in _PIN.findall(lock):
        if found.setdefault(name, version) != version:
            raise ValueError(f"{name}: {found[name]} and {version}, by the version of Python")
    return {name: version for name, version in found.items() if not _OF_A_PLATFORM.match(name)}


if __name__ == "__main__":
    print(HEAD, *(f"{name}=={version}" for name, version in pins(Path(sys.argv[1]).read_text()).items()), sep="\n")
