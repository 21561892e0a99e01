"""A file of methods and cs-rewards is run once, adds only, and leaves nothing where it fails."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from mtcsirl import names
from mtcsirl.errors import UserError
from mtcsirl.extensions import LOADED, METHODS, load_extensions
from mtcsirl.rewards.ground_truth import COMMON_SENSE_REWARDS
from tests.extensions.conftest import REWARD, Write

FIRST = "from mtcsirl.irl.methods import METHODS\nfrom mtcsirl.rewards.ground_truth import COMMON_SENSE_REWARDS\n"
TAKES = {
    "the package's reward": (
        REWARD.format(name="velocity", target=0.1),
        r"COMMON_SENSE_REWARDS\['velocity'\]: is registered by mtcsirl/rewards/ground_truth\.py, the package's own, "
        r"already; give yours a name of its own",
    ),
    "the package's reward with another target": (
        "from dataclasses import replace\n"
        + FIRST
        + "COMMON_SENSE_REWARDS['velocity'] = replace(COMMON_SENSE_REWARDS['velocity'], target=0.1)",
        r"COMMON_SENSE_REWARDS\['velocity'\]: is registered by mtcsirl/rewards/ground_truth\.py",
    ),
    "the package's method": (
        FIRST + "METHODS['mt_csirl'] = METHODS['mt_airl']",
        r"METHODS\['mt_csirl'\]: is registered by mtcsirl/irl/methods/mt_csirl\.py, the package's own, already",
    ),
    "the package's method by the registry alone": (
        "from mtcsirl.extensions import METHODS\nMETHODS['mt_airl'] = lambda setup: None",
        r"METHODS\['mt_airl'\]: is registered by mtcsirl/irl/methods/mt_airl\.py",
    ),
    "another extension's reward": (REWARD.format(name="theirs", target=2), r"is registered by .*theirs\.py already; "),
    "another extension's method": (
        FIRST + "METHODS['their_airl'] = METHODS['mt_vairl']",
        r"METHODS\['their_airl'\]: is registered by .*theirs\.py already; give yours .* or list one file only",
    ),
    "nothing and deletes": (FIRST + "del METHODS['mt_airl']", r"METHODS: takes 'mt_airl' away; an extension only adds"),
    "nothing and clears": (FIRST + "COMMON_SENSE_REWARDS.clear()", r"COMMON_SENSE_REWARDS: takes 'action_norm' away"),
}


@pytest.mark.parametrize("case", TAKES)
def test_a_name_that_is_taken_is_refused_with_both_files(case: str, write: Write) -> None:
    text, says = TAKES[case]
    theirs = REWARD.format(name="theirs", target=1) + FIRST + "METHODS['their_airl'] = METHODS['mt_airl']"
    load_extensions([write(theirs, "theirs.py")])
    before = dict(METHODS), dict(COMMON_SENSE_REWARDS), dict(LOADED)
    with pytest.raises(UserError, match=rf"^extensions: .*mine\.py: {says if says[0] != 'i' else '.*' + says}"):
        load_extensions([write(text)])
    assert before == (METHODS, COMMON_SENSE_REWARDS, LOADED)
    assert not any(name.startswith("mtcsirl_extension_mine") for name in sys.modules)


def test_the_registries_keep_the_packages_own_and_their_order(write: Write) -> None:
    with pytest.raises(UserError):
        load_extensions([write(REWARD.format(name="velocity", target=1))])
    assert tuple(METHODS) == names.METHODS
    assert tuple(COMMON_SENSE_REWARDS) == names.CS_REWARDS


def test_what_a_script_has_registered_its_own_file_may_register_again(write: Write) -> None:
    COMMON_SENSE_REWARDS["slow"] = COMMON_SENSE_REWARDS["velocity"]
    load_extensions([write(REWARD.format(name="slow", target=0.2))])
    assert COMMON_SENSE_REWARDS["slow"].target == 0.2


def test_a_file_that_is_given_twice_is_run_once(write: Write, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    file = write("import builtins\nbuiltins.runs = getattr(builtins, 'runs', 0) + 1\n")
    (tmp_path / "link.py").symlink_to(file)
    monkeypatch.chdir(tmp_path)
    load_extensions([file, "mine.py", "./mine.py", "link.py"])
    load_extensions([file])
    import builtins

    assert builtins.__dict__.pop("runs") == 1


def test_files_of_one_name_in_two_folders_are_two(write: Write) -> None:
    first = write(REWARD.format(name="one", target=1) + "HERE = 1\n", "a/mine.py")
    second = write(REWARD.format(name="two", target=2) + "HERE = 2\n", "b/mine.py")
    load_extensions([first, second, first])
    assert {"one", "two"} < set(COMMON_SENSE_REWARDS)
    assert [sys.modules[f"mtcsirl_extension_mine{tail}"].HERE for tail in ("", "_2")] == [1, 2]  # type: ignore[attr-defined]


def test_an_edit_of_the_same_second_and_size_is_seen(write: Write, clean: object) -> None:
    for target in (1.5, 2.5):
        clean()  # type: ignore[operator]
        file = write(REWARD.format(name="slow", target=target))
        os.utime(file, (1_700_000_000, 1_700_000_000))
        load_extensions([file])
        assert COMMON_SENSE_REWARDS["slow"].target == target
    assert [path.name for path in file.parent.iterdir()] == ["mine.py"]


def test_an_extension_may_define_a_dataclass_whose_annotations_are_texts(write: Write) -> None:
    text = "from __future__ import annotations\nfrom dataclasses import dataclass\n"
    load_extensions([write(f"{text}@dataclass\nclass Size:\n    metres: float\n")])


WRONG_FILES = {
    "data.txt": ("text", "must end in .py"),
    "mine.PY": ("", "must end in .py"),
    "mine": ("", "must end in .py"),
    "folder.py/x": ("", None),
    "syntax.py": ("def f(:\n", "SyntaxError: "),
    "bytes.py": ("x = '\x00'\n", "SyntaxError: "),
    "raises.py": ("raise ValueError('one\\ntwo')\n", "ValueError: one two"),
    "missing_module.py": ("import no_such_module\n", "ModuleNotFoundError: No module named 'no_such_module'"),
    "ends.py": ("import sys; sys.exit(0)\n", "ends the program (sys.exit); an extension must not"),
    "half.py": (REWARD.format(name="half", target=1) + "1 / 0\n", "ZeroDivisionError: division by zero"),
}


@pytest.mark.parametrize("name", WRONG_FILES)
def test_a_file_that_cannot_be_run_is_one_line(name: str, write: Write) -> None:
    text, says = WRONG_FILES[name]
    file = write(text, name)
    file = file if says else file.parent
    with pytest.raises(UserError) as caught:
        load_extensions([file])
    assert str(caught.value).startswith(f"extensions: {file}: {says or 'is a folder; name a Python file'}")
    assert "\n" not in str(caught.value)
    assert "half" not in COMMON_SENSE_REWARDS


def test_a_file_that_is_not_there_is_one_line(tmp_path: Path) -> None:
    with pytest.raises(UserError, match=r"extensions: .*gone\.py: no such file"):
        load_extensions([tmp_path / "gone.py"])


@pytest.mark.slow
@pytest.mark.parametrize("by", ["configuration", "environment"])
def test_both_ways_to_name_a_file_say_what_is_wrong_with_it(by: str, tmp_path: Path) -> None:
    (tmp_path / "data.txt").write_text("text")
    words = ["settings", "check", *(["--set", "extensions=[data.txt]"] if by == "configuration" else [])]
    variables = {"MTCSIRL_EXTENSIONS": "data.txt"} if by == "environment" else {}
    command = [sys.executable, "-m", "mtcsirl.cli", *words]
    done = subprocess.run(command, cwd=tmp_path, env=os.environ | variables, capture_output=True, text=True)
    assert (done.returncode, done.stderr) == (2, "mtcsirl: extensions: data.txt: must end in .py\n")
