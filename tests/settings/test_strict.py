"""What YAML would lose or misread is refused, in files, on the command line and by Snakemake alike."""

import subprocess
import sys
from pathlib import Path

import pytest
import yaml

from mtcsirl import cli
from mtcsirl.errors import UserError
from mtcsirl.settings.loading import load, override, read_yaml
from mtcsirl.settings.strict import DEEPEST, LONGEST, StrictError, parse, parse_json

BOMB = "a0: &a0 [x, x, x, x, x, x, x, x, x]\n" + "".join(
    f"a{n}: &a{n} [{', '.join([f'*a{n - 1}'] * 9)}]\n" for n in range(1, 9)
)
WRONG = [
    ("seeds: [0]\nseeds: [1]", "the key 'seeds' stands twice in one mapping (line 2)"),
    ("sac: {minibatch: 3, minibatch: 4}", "the key 'minibatch' stands twice in one mapping (line 1)"),
    ('{"seeds": [0], "seeds": [1]}', "the key 'seeds' stands twice in one mapping"),
    ('{"sac": {"minibatch": 3, "minibatch": 4}}', "the key 'minibatch' stands twice"),
    ("sac: {<<: {discount: 0.5, discount: 0.6}}", "the key 'discount' stands twice in one mapping (line 1); keep one"),
    ("a: {<<: [{b: 1}, {c: 2, c: 3}]}", "the key 'c' stands twice in one mapping (line 1)"),
    (
        "sac:\n  <<: {discount: 0.5}\n  <<: {discount: 0.6}",
        "the key '<<' stands twice in one mapping (line 3); merge a list, <<: [*one, *two]",
    ),
    ("seeds: [0100]", "0100 (line 1) is a number in base 8"),
    ("seeds: [-010]", "-010 (line 1) is a number in base 8"),
    ("seeds: [64:30]", "64:30 (line 1) is a number in base 60"),
    ("cs_weight: 1:30.5", "1:30.5 (line 1) is a number in base 60"),
    ("a: " + "[" * (DEEPEST + 5), f"nested more than {DEEPEST} deep"),
    ('{"a":' * 5000, f"nested more than {DEEPEST} deep"),
    (BOMB, "values once its aliases are written out"),
    ("a: &a [*a]", "values once its aliases are written out"),
    ("#" * (LONGEST + 1), "at most"),
    ("a: " + "9" * 5000, "not valid YAML"),
    ("a: 2026-13-45", "not valid YAML"),
    ("a: \x00", "not valid YAML"),
    ("a: !!python/object/apply:os.system [true]", "not valid YAML"),
]


@pytest.mark.parametrize(("text", "says"), WRONG, ids=[says for _, says in WRONG])
def test_what_would_be_misread_is_refused_in_one_line(text: str, says: str, tmp_path: Path) -> None:
    with pytest.raises(StrictError) as caught:
        parse(text)
    assert says in str(caught.value)
    file = tmp_path / "study.yaml"
    file.write_text(text)
    with pytest.raises(UserError, match=r"study\.yaml: ") as named:
        read_yaml(file)
    assert "\n" not in str(named.value)


def test_values_on_the_command_line_are_held_to_the_same() -> None:
    for assignment in ("seeds=[0100]", "seeds=[64:30]", "sac={minibatch: 3, minibatch: 4}"):
        with pytest.raises(UserError, match="--set"):
            override({}, [assignment])
    with pytest.raises(StrictError, match="stands twice"):
        parse_json('{"seeds": [0], "seeds": [1]}')


def test_what_yaml_and_reader_agree_on_is_read(checkout: Path) -> None:
    for file in (checkout / "config").glob("*.yaml"):
        assert parse(file.read_text()) == yaml.safe_load(file.read_text())
    for text in (
        "a: 0",
        "a: 10",
        "a: 0x1f",
        "a: 1_000",
        "a: 0.5",
        "a: yes",
        "a: 1e-4",
        "\ufeffa: 1",
        "a: 1\r\nb: 2\r\n",
    ):
        assert parse(text) == yaml.safe_load(text.removeprefix("\ufeff")), text
    shared = "one: &one {default: 3}\ntwo: *one\nthree: {<<: *one, reach: 4}\n"
    assert parse(shared) == yaml.safe_load(shared), "aliases and merges stay allowed"
    merged = f"{shared}four: &four {{<<: [*one, {{default: 9, push: 5}}], default: 7}}\nfive: {{<<: *four, push: 6}}\n"
    assert parse(merged) == yaml.safe_load(merged), "a key may stand in what is merged and beside it"


def _snakemake(checkout: Path, folder: Path, *arguments: str) -> subprocess.CompletedProcess[str]:
    command = ["snakemake", "--snakefile", str(checkout / "Snakefile"), "--quiet", "all", "--dry-run", "--cores", "1"]
    return subprocess.run(
        [sys.executable, "-m", *command, *arguments], cwd=folder, capture_output=True, text=True, check=False
    )


@pytest.mark.parametrize(("text", "says"), [WRONG[0], WRONG[2], WRONG[4]], ids=["twice", "twice in JSON", "octal"])
def test_snakemake_refuses_the_same_files(text: str, says: str, checkout: Path, tmp_path: Path) -> None:
    (tmp_path / "study.yaml").write_text(text)
    done = _snakemake(checkout, tmp_path, "table_5", "--configfile", "study.yaml")
    assert done.returncode != 0
    assert f"study.yaml: {says}" in done.stderr + done.stdout


def test_a_configuration_in_the_working_folder_steers_neither(
    checkout: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """One rule for both: config/config.yaml of the checkout, and what is named on the command line."""
    before = load()
    (tmp_path / "config").mkdir()
    (tmp_path / "config/config.yaml").write_text("seeds: [0, 0]\n")
    (tmp_path / "config/smoke.yaml").write_text("seeds: [0, 0]\n")
    monkeypatch.chdir(tmp_path)
    assert load() == before
    assert load(scale="smoke").seeds == (0,)
    assert cli.main(["settings", "check"]) == 0
    assert _snakemake(checkout, tmp_path, "table_5").returncode == 0
