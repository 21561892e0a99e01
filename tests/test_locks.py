"""constraints.txt and requirements.lock say the same, and what pyproject.toml asks for; both recipes take one way."""

import importlib.util
import re
import tomllib

import pytest
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

from tests.conftest import CHECKOUT

_spec = importlib.util.spec_from_file_location("locks", CHECKOUT / ".ci" / "locks.py")
locks = importlib.util.module_from_spec(_spec)
_spec.loader.exec_module(locks)

LOCK = (CHECKOUT / "requirements.lock").read_text(encoding="utf-8")
CONSTRAINTS = (CHECKOUT / "constraints.txt").read_text(encoding="utf-8")
PROJECT = tomllib.loads((CHECKOUT / "pyproject.toml").read_text(encoding="utf-8"))["project"]


def constraints(text: str) -> dict[str, str]:
    """Name -> version, read as pip reads it."""
    found = [Requirement(line) for line in text.splitlines() if line and not line.startswith("#")]
    return {canonicalize_name(one.name): str(one.specifier).removeprefix("==") for one in found}


def differences(first: dict[str, str], second: dict[str, str]) -> list[str]:
    return sorted(name for name in first.keys() | second.keys() if first.get(name) != second.get(name))


def unmet(requirements: list[str], pinned: dict[str, str]) -> list[str]:
    """Requirements whose package has no pin, or one that is not allowed."""
    wanted = {text: Requirement(text) for text in requirements}
    found = {text: pinned.get(canonicalize_name(one.name)) for text, one in wanted.items()}
    return [text for text, one in wanted.items() if found[text] is None or not one.specifier.contains(found[text])]


def without_checksums(lock: str) -> list[str]:
    """Packages of a lock that pip would refuse, for want of a checksum."""
    entries = re.split(r"^(?=[a-z0-9])", lock, flags=re.MULTILINE)
    return [entry.partition("==")[0] for entry in entries if "==" in entry and "--hash=sha256:" not in entry]


def test_both_have_the_same_versions():
    assert differences(constraints(CONSTRAINTS), locks.pins(LOCK)) == []


def test_a_version_that_differs_and_one_that_is_missing_are_seen():
    changed = CONSTRAINTS.replace("numpy==", "numpy==9").replace("scipy==", "scipyy==")
    assert differences(constraints(changed), locks.pins(LOCK)) == ["numpy", "scipy", "scipyy"]
    with pytest.raises(ValueError, match="a: 1 and 2"):
        locks.pins("a==1 ; python_version < '3.12' \\\na==2 \\\n")


def test_they_hold_what_the_project_asks_for():
    extras = PROJECT["optional-dependencies"].values()
    wanted = [one for group in (PROJECT["dependencies"], *extras) for one in group]
    assert unmet(wanted, constraints(CONSTRAINTS)) == []


def test_a_requirement_that_is_not_held_is_seen():
    assert unmet(["numpy>=99", "no-such-package", "scipy"], constraints(CONSTRAINTS)) == [
        "numpy>=99",
        "no-such-package",
    ]


def test_every_package_has_a_checksum_and_no_address():
    assert without_checksums(LOCK) == []
    assert "://" not in LOCK
    assert without_checksums("a==1 \\\n    --hash=sha256:00\nb==1\n") == ["b"]


def test_both_recipes_take_the_steps_of_one_script():
    """In the same order, from the same Debian, and every step that they name is there."""
    script = (CHECKOUT / "containers" / "install").read_text(encoding="utf-8")
    found = {}
    for name in ("Containerfile", "apptainer.def"):
        text = (CHECKOUT / "containers" / name).read_text(encoding="utf-8")
        found[name] = (
            re.findall(r"(?i)^from:? (\S+)$", text, re.MULTILINE),
            re.findall(r"/install (\w+)$", text, re.M),
        )
    assert found["Containerfile"] == found["apptainer.def"] == (["debian:12"], ["environment", "suite"])
    assert re.findall(r"^(\w+)\)$", script, re.MULTILINE) == ["environment", "suite"]
