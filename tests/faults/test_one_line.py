"""What a user can cause is one line and no traceback; what only a bug can cause asks to be reported."""

import os
import random
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from mtcsirl import __version__, cli
from mtcsirl.errors import UserError
from mtcsirl.extensions import load_extensions
from tests.faults.command import environment, mtcsirl, one_line, train
from tests.faults.harness import LONG

pytestmark = pytest.mark.slow


def _run(command: list[str], **options: object) -> subprocess.CompletedProcess[str]:
    return subprocess.run(command, capture_output=True, text=True, **options)  # type: ignore[call-overload]


@pytest.fixture
def mounted(tmp_path: Path, request: pytest.FixtureRequest) -> Iterator[Path]:
    """A small file system of its own."""
    disk = tmp_path / "disk"
    disk.mkdir()
    done = _run(["mount", "-t", "tmpfs", "-o", request.param, "none", str(disk)]) if os.getuid() == 0 else None
    if done is None or done.returncode:
        pytest.skip("mounting a file system needs root and the right to mount")
    yield disk
    subprocess.run(["umount", "--lazy", str(disk)], check=True)


@pytest.mark.parametrize("mounted", ["size=64k"], indirect=True)
def test_a_full_disk_names_the_file_and_keeps_what_is_there(mounted: Path) -> None:
    line = one_line(_run(train(mounted / "run")))
    assert "No space left on device; make room there" in line
    assert f"mtcsirl: {mounted}/run/checkpoint.safetensors: " in line
    assert not list(mounted.rglob("*.tmp"))


@pytest.mark.parametrize("mounted", ["size=1m"], indirect=True)
def test_a_disk_that_is_full_at_any_file_of_a_run(mounted: Path) -> None:
    """Filled up to a random number of free pages; with room made, the same command ends with all results."""
    filler, free = mounted / "filler", os.statvfs(mounted)
    pages = free.f_bavail * free.f_frsize // 4096
    left = random.Random(0).sample(range(2, 30), 20 if LONG else 3)
    failed = 0
    for number, leave in enumerate(left):
        folder = mounted / f"run {number}"
        filler.write_bytes(bytes(4096 * (pages - leave)))
        done = _run(train(folder))
        if done.returncode:
            assert "No space left on device" in one_line(done)
            failed += 1
        filler.unlink()
        assert _run(train(folder)).returncode == 0
        assert not [path for path in folder.glob(".*") if path.suffix != ".made"]
        for path in folder.iterdir():
            path.unlink()
    assert failed > len(left) / 2, "the harness fills the disk"


@pytest.mark.parametrize("mounted", ["ro"], indirect=True)
def test_a_read_only_file_system_is_noticed_before_any_work(mounted: Path) -> None:
    assert f"{mounted}: cannot be written" in one_line(_run(train(mounted / "run")))


def test_an_output_that_cannot_be_is_noticed_before_any_work(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    assert "file: is a file; name a folder" in one_line(_run(train(tmp_path / "file")))
    assert "file: is a file, so that" in one_line(_run(train(tmp_path / "file/run")))
    assert "is a folder; name a file" in one_line(_run(mtcsirl("calibrate", "--output", str(tmp_path))))
    assert "must not be empty" in one_line(_run(mtcsirl("train-sac", "--output", "")))


@pytest.mark.skipif(os.getuid() == 0, reason="root may write everywhere")
def test_a_folder_without_permission_is_named(tmp_path: Path) -> None:
    (tmp_path / "closed").mkdir(mode=0o500)
    assert "closed: cannot be written" in one_line(_run(train(tmp_path / "closed/run")))


@pytest.mark.parametrize("limit", [400_000, 2_600_000], ids=["while importing", "while allocating"])
def test_too_little_memory_is_one_line(tmp_path: Path, limit: int) -> None:
    command = train(tmp_path / "run", steps=9_000_000)
    done = _run(["bash", "-c", f'ulimit -v {limit}; exec "$@"', "bash", *command])
    if limit > 1_000_000:
        assert "out of memory (" in one_line(done)
    assert done.returncode != 0
    assert not (tmp_path / "run/policy.json").exists()


@pytest.mark.parametrize(
    ("error", "says"),
    [
        (MemoryError("Unable to allocate 3 GiB"), "out of memory (Unable to allocate 3 GiB)"),
        (
            RuntimeError("DefaultCPUAllocator: can't allocate memory: 5 bytes\nmore"),
            "out of memory (DefaultCPUAllocator",
        ),
        (ImportError("libtorch.so: failed to map segment from shared object"), "out of memory (libtorch.so"),
        (RecursionError("maximum recursion depth exceeded"), "nested too deeply"),
        (PermissionError(13, "Permission denied", "/etc/x"), "/etc/x: Permission denied; change its permissions"),
        (FileNotFoundError(2, "No such file or directory", "/x/y"), "/x/y: No such file or directory"),
        (OSError(28, "No space left on device"), "No space left on device; make room there"),
        (UserError("one\ntwo"), "one two"),
    ],
    ids=lambda value: type(value).__name__ if isinstance(value, Exception) else "",
)
def test_explained(error: Exception, says: str) -> None:
    line = cli.explained(error)
    assert line is not None
    assert says in line
    assert "\n" not in line


@pytest.mark.parametrize("error", [KeyError("x"), RuntimeError("x"), BrokenPipeError(32, "Broken pipe"), OSError("x")])
def test_what_is_no_fault_of_a_user_is_not_explained_away(error: Exception) -> None:
    assert cli.explained(error) is None


def test_a_bug_asks_to_be_reported(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    def broken(settings: object) -> list[str]:
        raise KeyError("no such thing")

    monkeypatch.setattr("mtcsirl.settings.template.deviations", broken)
    assert cli.main(["deviations", "--scale", "smoke"]) == 1
    lines = capsys.readouterr().err.splitlines()
    assert lines[0].startswith("Traceback")
    says = f"this is a bug; please report the lines above, version {__version__} and mtcsirl deviations --scale smoke"
    assert lines[-1] == f"mtcsirl: {says}"


EXTENSIONS = {
    "sys.exit(0)": "import sys; sys.exit(0)",
    "exit()": "raise SystemExit",
    "an error of two lines": "raise ValueError('one\\ntwo')",
    "a syntax error": "def f(:\n",
}


@pytest.mark.parametrize("name", EXTENSIONS)
def test_an_extension_that_ends_or_fails_is_an_error(tmp_path: Path, name: str) -> None:
    file = tmp_path / "mine.py"
    file.write_text(EXTENSIONS[name])
    with pytest.raises(UserError, match=r"extensions: .*mine\.py: ") as caught:
        load_extensions([file])
    assert "\n" not in str(caught.value)
    done = _run(mtcsirl("plan"), env=environment(MTCSIRL_EXTENSIONS=str(file)))
    assert "mine.py: " in one_line(done)


def test_code_that_exits_in_the_middle_of_a_job_is_an_error(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("mtcsirl.settings.template.deviations", lambda settings: sys.exit(0))
    assert cli.main(["deviations", "--scale", "smoke"]) == 2
    assert "test_one_line.py:" in (line := capsys.readouterr().err)
    assert "ended the job by sys.exit" in line


def test_mujoco_leaves_no_log_in_the_working_directory(tmp_path: Path) -> None:
    code = (
        "import numpy as np; from mtcsirl.worlds.environments import make_environment\n"
        "e = make_environment('reach', 0); e.reset()\n"
        "for _ in range(5): print(e.step(np.full(4, np.nan, dtype=np.float32))[-1]['diverged'])"
    )
    done = _run([sys.executable, "-c", code], cwd=tmp_path, check=True)
    assert done.stdout.split() == ["True"] * 5
    assert not list(tmp_path.iterdir())
    assert done.stderr.splitlines()[0].startswith("MuJoCo: Nan, Inf or huge value in CTRL")
    assert len(done.stderr.splitlines()) <= 3, "each kind once"
