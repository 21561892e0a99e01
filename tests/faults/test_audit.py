"""`make audit` fails when it could not look, as when it found something; a stand-in speaks for pip-audit."""

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

pytestmark = pytest.mark.slow

CLEAN = {"name": "numpy", "version": "2.4.6", "vulns": []}
SKIPPED = {"name": "torch", "skip_reason": "Dependency not found on PyPI and could not be audited: torch (2.13.0)"}
BAD = {"name": "pillow", "version": "1.0", "vulns": [{"id": "PYSEC-1", "fix_versions": ["1.1"]}]}


@pytest.mark.parametrize(
    ("found", "code", "says"),
    [
        ([CLEAN], 0, "audit: 1 dependencies, no known vulnerability"),
        ([CLEAN, SKIPPED], 2, "audit: 1 of 2 dependencies could not be looked up: Dependency not found on PyPI"),
        ([BAD, SKIPPED], 1, "pillow 1.0: PYSEC-1, mended in 1.1\naudit: 1 known vulnerabilities in 2 dependencies"),
        ([], 2, "audit: 0 of 0 dependencies could not be looked up: the list is empty"),
        (None, 2, "audit: the database cannot be reached, nothing was looked up: ConnectionError: no such host"),
    ],
    ids=["clean", "skipped", "known", "empty", "unreachable"],
)
def test_what_it_makes_of_an_answer(
    tmp_path: Path, checkout: Path, found: list[dict[str, Any]] | None, code: int, says: str
) -> None:
    says_nothing = "raise SystemExit('ConnectionError: no such host')"
    answer = says_nothing if found is None else f"print({json.dumps({'dependencies': found})!r})"
    tool = tmp_path / "pip-audit"
    tool.write_text(f"#!{sys.executable}\n{answer}\n")
    tool.chmod(0o755)
    command = [sys.executable, str(checkout / ".ci/audit.py"), str(tool), "constraints.txt"]
    done = subprocess.run(command, capture_output=True, text=True)
    assert done.returncode == code
    assert done.stdout.startswith(says)
    assert not done.stderr
