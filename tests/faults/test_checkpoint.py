"""A checkpoint is what its run wrote, to the bit, or the run starts over; and it costs no second copy in memory."""

import hashlib
import json
import random
import subprocess
import sys
from pathlib import Path

import pytest
import safetensors.torch
import torch

from mtcsirl.files import storage
from mtcsirl.files.checkpoint import load_checkpoint, save_checkpoint
from tests.faults.harness import LONG, Stage, contents, ended, fork

pytestmark = pytest.mark.slow

TENSORS = {
    "rows": torch.arange(60.0).reshape(2, 10, 3)[:, :7],
    "count": torch.tensor(7),
    "none": torch.empty(0, 4),
    "flags": torch.tensor([True, False]),
    "half": torch.ones(3, dtype=torch.bfloat16),
    "state": torch.arange(5, dtype=torch.uint8),
}
NOTES = {"step": 7, "curve": [[1, "success", 0.5]], "big": 2**127}


@pytest.fixture
def file(tmp_path: Path) -> Path:
    file = tmp_path / "checkpoint.safetensors"
    save_checkpoint(file, TENSORS, NOTES, run="a run")
    return file


def test_it_comes_back_as_it_was(file: Path) -> None:
    found = load_checkpoint(file, run="a run")
    assert found is not None
    tensors, notes = found
    assert notes == NOTES
    assert list(sorted(tensors)) == list(sorted(TENSORS))
    assert all(torch.equal(tensors[n], t) and tensors[n].dtype == t.dtype for n, t in TENSORS.items())
    theirs = safetensors.torch.load_file(file)
    assert all(torch.equal(theirs[name], tensor) for name, tensor in TENSORS.items()), "any reader of the format"
    again = file.with_name("again")
    save_checkpoint(again, dict(reversed(TENSORS.items())), NOTES, run="a run")
    assert again.read_bytes() == file.read_bytes()


def test_none_is_no_news(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    assert load_checkpoint(tmp_path / "none", run="a run") is None
    assert not caplog.records


def test_one_of_another_run_is_not_taken_up(file: Path, caplog: pytest.LogCaptureFixture) -> None:
    assert load_checkpoint(file, run="another run") is None
    assert [r.message for r in caplog.records] == [
        f"{file}: of a run with other settings, inputs or code; starting from the beginning"
    ]


def _damages(data: bytes) -> dict[str, bytes]:
    random_ = random.Random(0)
    bits = range(8 * len(data)) if LONG else random_.sample(range(8 * len(data)), 300)
    damages = {f"bit {bit}": _flipped(data, bit) for bit in bits}
    damages |= {f"cut at {n}": data[:n] for n in (0, 1, 7, 8, 9, 100, len(data) - 33, len(data) - 32, len(data) - 1)}
    damages |= {f"zeros from {n}": data[:n] + bytes(len(data) - n) for n in (0, 8, 200, len(data) - 40)}
    return damages | {"longer": data + b"\0", "twice": 2 * data, "text": b"half a file"}


def _flipped(data: bytes, bit: int) -> bytes:
    changed = bytearray(data)
    changed[bit // 8] ^= 1 << bit % 8
    return bytes(changed)


def test_no_damage_passes(file: Path, caplog: pytest.LogCaptureFixture) -> None:
    for name, data in _damages(file.read_bytes()).items():
        caplog.clear()
        file.write_bytes(data)
        assert load_checkpoint(file, run="a run") is None, name
        (record,) = caplog.records
        assert record.message.startswith(f"{file}: damaged")
        assert "\n" not in record.message


def test_a_reader_without_checksum_would_not_notice(file: Path) -> None:
    data = file.read_bytes()
    payload = data.index(TENSORS["rows"][1, 0].numpy().tobytes())
    other = safetensors.torch.load(_flipped(data, 8 * payload + 20))
    assert not torch.equal(other["rows"], TENSORS["rows"])


def test_headers_that_lie_with_a_right_checksum(file: Path, tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    """What no accident makes: a foreign file. It is refused as a damaged one, whatever it claims."""
    data = file.read_bytes()
    length = int.from_bytes(data[:8], "little")
    header, payload = json.loads(data[8 : 8 + length]), data[8 + length : -32]
    lies = {
        "no list": {**header, "rows": 3},
        "a kind that is none": {**header, "rows": {**header["rows"], "dtype": "PICKLE"}},
        "a huge shape": {**header, "rows": {**header["rows"], "shape": [2**40, 2**40]}},
        "a negative shape": {**header, "rows": {**header["rows"], "shape": [-2, -7, 3]}},
        "huge offsets": {**header, "rows": {"dtype": "U8", "shape": [2**50], "data_offsets": [0, 2**50]}},
        "no run": {name: entry for name, entry in header.items() if name != "__metadata__"},
        "no notes": {name: entry for name, entry in header.items() if name != "notes"},
    }
    texts = {name: json.dumps(lie).encode() for name, lie in lies.items()} | {"deep": b"[" * 100_000, "list": b"[]"}
    for name, text in texts.items():
        body = len(text).to_bytes(8, "little") + text + payload
        file.write_bytes(body + hashlib.sha256(body).digest())
        caplog.clear()
        assert load_checkpoint(file, run="a run") is None, name
        assert "damaged" in caplog.text, name
    body = (2**63).to_bytes(8, "little") + payload
    file.write_bytes(body + hashlib.sha256(body).digest())
    assert load_checkpoint(file, run="a run") is None


MEASURE = """
import sys, torch
from pathlib import Path
from mtcsirl.files.checkpoint import load_checkpoint, save_checkpoint
def memory(name):
    return next(int(line.split()[1]) / 1024 for line in open("/proc/self/status") if line.startswith(name))
def growth(work):
    open("/proc/self/clear_refs", "w").write("5")
    before = memory("VmRSS")
    kept = work()
    return memory("VmHWM") - before
rows = torch.ones(8, int(sys.argv[2]) * 2**20 // (8 * 4 * 83) * 2, 83)
part = rows[:, : rows.shape[1] // 2]
file = Path(sys.argv[1])
save_checkpoint(file, {"few": torch.ones(3)}, {}, run="")
print(growth(lambda: save_checkpoint(file, {"rows": part}, {}, run="")), growth(lambda: load_checkpoint(file, run="")))
"""


@pytest.mark.skipif(not Path("/proc/self/clear_refs").exists(), reason="peak memory is reset through Linux's /proc")
def test_writing_needs_no_second_copy(tmp_path: Path) -> None:
    size = 300 if LONG else 60
    command = [sys.executable, "-c", MEASURE, str(tmp_path / "checkpoint"), str(size)]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    writing, reading = (float(word) for word in done.stdout.split())
    print(f"{size} MiB: writing {writing:.1f} MiB more, reading {reading:.1f}")
    assert writing < 20
    assert reading < size + 20


def test_a_run_whose_checkpoint_is_damaged_starts_over(stage: Stage, tmp_path: Path) -> None:
    whole, other = tmp_path / "whole", tmp_path / "kept"
    assert ended(fork(lambda: stage(whole))) == 0

    def keep(place: Path) -> None:
        storage.remove = lambda path: None
        stage(place)

    assert ended(fork(lambda: keep(other))) == 0
    (checkpoint,) = other.glob("checkpoint*")
    data, random_ = checkpoint.read_bytes(), random.Random(1)
    bit = random_.randrange(8 * len(data))
    for number, damaged in enumerate((_flipped(data, bit), data[: len(data) // 2], bytes(len(data)))):
        folder = tmp_path / str(number)
        folder.mkdir()
        (folder / checkpoint.name).write_bytes(damaged)
        assert ended(fork(lambda folder=folder: stage(folder))) == 0
        assert contents(folder) == contents(whole)


def test_a_job_says_what_is_wrong(file: Path) -> None:
    file.write_bytes(b"half")
    code = f"from mtcsirl.files.checkpoint import load_checkpoint; load_checkpoint({str(file)!r}, run='')"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stderr == f"{file}: damaged, or of an older version; starting from the beginning\n"
