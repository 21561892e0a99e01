"""No half-written file, no unpickling, one clear line for what cannot be read, one writer per folder."""

import errno
import json
import multiprocessing
import pickle
import re
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
import torch

from mtcsirl.errors import UserError
from mtcsirl.files import storage

FRAME = pd.DataFrame({"task": ["reach", "push"], "value": [0.1, 2.0]})
TENSORS = {"a": torch.arange(6.0).reshape(2, 3), "b": torch.ones(1, dtype=torch.int64)}
WRITERS: dict[str, Callable[[Path], None]] = {
    "text": lambda path: storage.write_text(path, "new"),
    "bytes": lambda path: storage.write_bytes(path, b"new"),
    "json": lambda path: storage.write_json(path, {"a": 1}),
    "csv": lambda path: storage.write_csv(path, FRAME),
    "parquet": lambda path: storage.write_parquet(path, FRAME),
    "tensors": lambda path: storage.write_tensors(path, TENSORS),
}
READERS: dict[str, Callable[[Path], Any]] = {
    "json": storage.read_json,
    "parquet": storage.read_parquet,
    "tensors": storage.read_tensors,
}


def test_round_trips(tmp_path: Path) -> None:
    storage.write_json(tmp_path / "a.json", {"b": [1, 2.5], "a": None})
    assert storage.read_json(tmp_path / "a.json") == {"b": [1, 2.5], "a": None}
    storage.write_csv(tmp_path / "a.csv", FRAME)
    pd.testing.assert_frame_equal(storage.read_csv(tmp_path / "a.csv"), FRAME, check_dtype=False)
    storage.write_parquet(tmp_path / "a.parquet", FRAME)
    pd.testing.assert_frame_equal(storage.read_parquet(tmp_path / "a.parquet"), FRAME, check_dtype=False)
    assert list(storage.read_parquet(tmp_path / "a.parquet", ("value",)).columns) == ["value"]
    storage.write_tensors(tmp_path / "a.safetensors", TENSORS)
    read = storage.read_tensors(tmp_path / "a.safetensors")
    assert all(torch.equal(read[name], tensor) for name, tensor in TENSORS.items())
    storage.write_text(tmp_path / "a.txt", "ü\n")
    assert storage.read_text(tmp_path / "a.txt") == "ü\n"


@pytest.mark.parametrize("name", WRITERS)
def test_equal_data_gives_equal_bytes(tmp_path: Path, name: str) -> None:
    for copy in ("1", "2"):
        WRITERS[name](tmp_path / copy)
    assert (tmp_path / "1").read_bytes() == (tmp_path / "2").read_bytes()


@pytest.mark.parametrize("name", WRITERS)
def test_a_full_disk_leaves_the_old_file(tmp_path: Path, name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "file"
    path.write_text("old")

    def full(handle: int) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr("os.fsync", full)
    with pytest.raises(OSError, match="No space left") as caught:
        WRITERS[name](path)
    assert caught.value.filename == str(path)
    assert path.read_text() == "old"
    assert [entry.name for entry in tmp_path.iterdir()] == ["file"], "no temporary file stays behind"


def test_an_error_inside_the_block_leaves_nothing(tmp_path: Path) -> None:
    def fail(handle: Any) -> None:
        handle.write("half")
        raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError), storage.atomic(tmp_path / "file") as handle:
        fail(handle)
    assert not list(tmp_path.iterdir())


def test_not_a_number_is_no_json(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="not JSON compliant"):
        storage.write_json(tmp_path / "a.json", {"a": float("nan")})
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("name", READERS)
def test_a_missing_file_is_named(tmp_path: Path, name: str) -> None:
    with pytest.raises(UserError, match=rf"^{re.escape(str(tmp_path))}/none: no such file"):
        READERS[name](tmp_path / "none")


@pytest.mark.parametrize("name", READERS)
def test_a_truncated_file_is_one_line(tmp_path: Path, name: str) -> None:
    path = tmp_path / "file"
    WRITERS[name](path)
    path.write_bytes(path.read_bytes()[:-5])
    with pytest.raises(UserError) as caught:
        READERS[name](path)
    assert "\n" not in str(caught.value)
    assert str(path) in str(caught.value)
    assert "make it again" in str(caught.value)


class Trap:
    """Runs a command when it is unpickled."""

    def __init__(self, mark: Path) -> None:
        self.mark = mark

    def __reduce__(self) -> tuple:
        return Path.touch, (self.mark,)


@pytest.mark.parametrize("name", READERS)
def test_a_pickle_is_refused_and_does_not_run(tmp_path: Path, name: str) -> None:
    path, mark = tmp_path / "file", tmp_path / "trap"
    path.write_bytes(pickle.dumps(Trap(mark)))
    with pytest.raises(UserError):
        READERS[name](path)
    assert not mark.exists()
    pickle.loads(path.read_bytes())  # the trap works
    assert mark.exists()


def test_no_module_unpickles(checkout: Path) -> None:
    forbidden = re.compile(r"import pickle|pickle\.load|torch\.load\(|joblib|allow_pickle=True|\.load_from_zip|dill")
    for path in (checkout / "src").rglob("*.py"):
        assert not forbidden.search(path.read_text()), path


def test_a_missing_column_is_named(tmp_path: Path) -> None:
    storage.write_csv(tmp_path / "a.csv", FRAME)
    with pytest.raises(UserError, match=r"a\.csv: lacks the column seed"):
        storage.read_csv(tmp_path / "a.csv", ("task", "seed"))


def test_empty_cs_reward_stays_text(tmp_path: Path) -> None:
    storage.write_csv(tmp_path / "a.csv", pd.DataFrame({"cs_reward": [""], "value": [np.nan]}))
    frame = storage.read_csv(tmp_path / "a.csv")
    assert frame["cs_reward"].to_list() == [""]
    assert np.isnan(frame["value"][0])


def _hold(folder: Path, holds: Any, done: Any) -> None:
    with storage.locked(folder):
        holds.set()
        done.wait(300)


def test_a_folder_has_one_writer(tmp_path: Path) -> None:
    context = multiprocessing.get_context("spawn")
    holds, done = context.Event(), context.Event()
    other = context.Process(target=_hold, args=(tmp_path / "run", holds, done))
    other.start()
    try:
        assert holds.wait(300)
        assert storage.is_locked(tmp_path / "run")
        with pytest.raises(UserError, match="another process writes here"), storage.locked(tmp_path / "run"):
            pass
    finally:
        done.set()
        other.join()
    assert not storage.is_locked(tmp_path / "run")
    with storage.locked(tmp_path / "run"):
        pass
    assert not (tmp_path / "run/.lock").exists()


def test_asking_for_a_lock_takes_none(tmp_path: Path) -> None:
    assert not storage.is_locked(tmp_path)
    assert not list(tmp_path.iterdir())


def test_a_killed_writer_leaves_no_lock(tmp_path: Path) -> None:
    code = "import os, sys; from mtcsirl.files.storage import locked\nwith locked(sys.argv[1]): os.kill(os.getpid(), 9)"
    subprocess.run([sys.executable, "-c", code, str(tmp_path)], check=False)
    assert (tmp_path / ".lock").exists(), "the file stays, the lock does not"
    assert not storage.is_locked(tmp_path)
    with storage.locked(tmp_path):
        pass


def test_checksum(tmp_path: Path) -> None:
    storage.write_text(tmp_path / "a", "abc")
    assert storage.checksum(tmp_path / "a") == "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad"


def test_append_line(tmp_path: Path) -> None:
    for line in ("a", "b\n"):
        storage.append_line(tmp_path / "log/file", line)
    assert (tmp_path / "log/file").read_text() == "a\nb\n"


def test_json_is_sorted(tmp_path: Path) -> None:
    storage.write_json(tmp_path / "a", {"b": 1, "a": 2})
    assert list(json.loads((tmp_path / "a").read_text())) == ["a", "b"]
