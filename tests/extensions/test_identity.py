"""What an extension registers is a part of the identity of the runs that use it, whatever file its numbers are in."""

import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from mtcsirl.extensions import load_extensions
from mtcsirl.files.fingerprint import Code
from mtcsirl.study.code import artefact_code, code_of
from tests.extensions.conftest import REWARD, Write

IMPORTS = """import sys
from functools import partial
from pathlib import Path
from dataclasses import replace
from mtcsirl.irl.methods import METHODS
from mtcsirl.rewards.ground_truth import COMMON_SENSE_REWARDS, CommonSenseReward, action_norm, velocity
sys.path.insert(0, str(Path(__file__).parent))
"""
POWER = (
    IMPORTS
    + """def power(t, k): return t.action.abs().pow(k).sum(-1)
COMMON_SENSE_REWARDS["mine"] = CommonSenseReward("mine", partial(power, k={}), 1.0, "u")
"""
)
METHOD = IMPORTS + "METHODS['mine'] = partial(lambda setup, base: METHODS[base](setup), base='{}')\n"
BORROWED = IMPORTS + "from helper import {}\nCOMMON_SENSE_REWARDS['mine'] = CommonSenseReward('mine', {}, 1.0, 'u')\n"
HELPER = "def power(t): return t.action.abs().pow({}).sum(-1)\n"
NUMBERS = (
    IMPORTS
    + "from helper import NUMBERS\nCOMMON_SENSE_REWARDS['mine'] = CommonSenseReward('mine', velocity, **NUMBERS)\n"
)

Files = dict[str, str]
EDITS: dict[str, tuple[Files, Files]] = {
    "target": (
        {"mine.py": REWARD.format(name="mine", target=0.2)},
        {"mine.py": REWARD.format(name="mine", target=0.4)},
    ),
    "partial": ({"mine.py": POWER.format(2)}, {"mine.py": POWER.format(4)}),
    "partial method": ({"mine.py": METHOD.format("mt_airl")}, {"mine.py": METHOD.format("mt_vairl")}),
    "package's measure": (
        {"mine.py": BORROWED.replace("from helper import {}\n", "").format("velocity")},
        {"mine.py": BORROWED.replace("from helper import {}\n", "").format("action_norm")},
    ),
    "imported measure": (
        {"mine.py": BORROWED.format("power", "power"), "helper.py": HELPER.format(2)},
        {"mine.py": BORROWED.format("power", "power"), "helper.py": HELPER.format(4)},
    ),
    "measure imported by the imported": (
        {
            "mine.py": BORROWED.format("power", "power"),
            "helper.py": "from deep import *\n",
            "deep.py": HELPER.format(2),
        },
        {
            "mine.py": BORROWED.format("power", "power"),
            "helper.py": "from deep import *\n",
            "deep.py": HELPER.format(4),
        },
    ),
    "measure of a package": (
        {
            "mine.py": BORROWED.replace("helper", "kit.inner").format("power", "power"),
            "kit/__init__.py": "",
            "kit/inner.py": "from .core import power\n",
            "kit/core.py": HELPER.format(2),
        },
        {
            "mine.py": BORROWED.replace("helper", "kit.inner").format("power", "power"),
            "kit/__init__.py": "",
            "kit/inner.py": "from .core import power\n",
            "kit/core.py": HELPER.format(4),
        },
    ),
    "imported inside a function": (
        {"mine.py": POWER.format(2).replace("k): ", "k): import later; ", 1), "later.py": "K = 2\n"},
        {"mine.py": POWER.format(2).replace("k): ", "k): import later; ", 1), "later.py": "K = 3\n"},
    ),
    "another import under the same name": (
        {"mine.py": BORROWED.format("power", "power"), "helper.py": "from math import sin as f\n" + HELPER.format(2)},
        {"mine.py": BORROWED.format("power", "power"), "helper.py": "from math import cos as f\n" + HELPER.format(2)},
    ),
    "weight": (
        {"mine.py": NUMBERS, "helper.py": "NUMBERS = dict(target=1, unit='u', weight=1)"},
        {"mine.py": NUMBERS, "helper.py": "NUMBERS = dict(target=1, unit='u', weight=2)"},
    ),
    "registers nothing": (
        {"mine.py": "import mtcsirl.names as names; A = 1\n"},
        {"mine.py": "import mtcsirl.names as names; A = 2\n"},
    ),
}


@pytest.fixture
def identity(write: Write, clean: Callable[[], None]) -> Callable[[Files], Code]:
    """The code of an IRL run of the method ``mine`` with mine.py as its extension, in a new process as it were."""

    def code(files: Files) -> Code:
        clean()
        paths = [write(text, name) for name, text in files.items()]
        sys.path_importer_cache.clear()
        load_extensions(paths[:1])
        return code_of("learn_reward", {}, "mine")

    return code


@pytest.mark.parametrize("edit", EDITS)
def test_an_edit_is_another_identity(edit: str, identity: Callable[[Files], Code]) -> None:
    before, after = EDITS[edit]
    old = identity(before)
    assert identity(before) == old
    assert identity(after) != old


def test_numbers_count_by_value_wherever_they_come_from(write: Write, monkeypatch: pytest.MonkeyPatch) -> None:
    text = REWARD.format(name="slow", target="float(__import__('os').environ['TARGET'])").replace("m/s", "cm/s")
    monkeypatch.setenv("TARGET", "0.5")
    load_extensions([write(text)])
    found = artefact_code("tables.table_2")
    assert {name: found[f"slow.{name}"] for name in ("target", "unit", "weight")} == {
        "target": "0.5",
        "unit": "cm/s",
        "weight": "1.0",
    }


def test_a_comment_is_no_edit(identity: Callable[[Files], Code]) -> None:
    text = REWARD.format(name="mine", target=0.2)
    assert identity({"mine.py": text}) == identity({"mine.py": f'"""Slow."""\n\n{text}# as the paper\n'})


def test_files_of_one_name_both_count(write: Write) -> None:
    load_extensions([write(REWARD.format(name=name, target=1), f"{name}/mine.py") for name in ("one", "two")])
    assert {"mine.py", "mine.py#2", "one.target", "two.target"} <= set(code_of("train_sac", {}))


def test_a_method_counts_in_its_own_runs_alone_and_holds_those_it_may_be_made_from(write: Write) -> None:
    alone = {method: code_of("learn_reward", {}, method) for method in ("", "mt_csirl")}
    load_extensions([write(METHOD.format("mt_airl"))])
    own = code_of("learn_reward", {}, "mine")
    assert set(own) - set(alone[""]) >= {"mine.py", "mt_airl", "mt_csirl_lt", "penalised"}
    assert {method: code_of("learn_reward", {}, method) for method in ("", "mt_csirl")} == alone
    assert not any("mine" in name for name in artefact_code("tables.table_2"))


def test_what_is_installed_or_of_the_package_is_no_file_of_ones_own(write: Write, tmp_path: Path) -> None:
    write("", "site-packages/other.py")
    text = f"import sys; sys.path.insert(0, {str(tmp_path / 'site-packages')!r})\nimport json, torch, other, mtcsirl\n"
    load_extensions([write(text + REWARD.format(name="mine", target=1))])
    files = {name for name in code_of("train_sac", {}) if name.endswith(".py")}
    assert files == {"mine.py"}
