"""Parts that a stranger wrote, with manifests that fit: verify says so in lines, and unpack writes nothing."""

import errno
import json
import os
import shutil
import signal
import subprocess
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from mtcsirl import cli
from mtcsirl.episodes.evaluation import metrics
from mtcsirl.errors import UserError
from mtcsirl.files import storage
from mtcsirl.files.identity import FILE, digest_of, dumps, parse_record, read_record
from mtcsirl.results import archive, verdicts
from mtcsirl.results.packing import by_folder
from mtcsirl.results.soundness import leaves
from mtcsirl.results.verdicts import faults_of_gate
from mtcsirl.study.outputs import OUTPUTS
from tests.conftest import CHECKOUT
from tests.results.small_study import IRL, SHOWN, STUDY, add, settings, write

EXPERT, SCORE = STUDY.experts[0].folder, STUDY.scores[0].folder
TRANSFER = next(run.folder for run in STUDY.transfers if run.irl == IRL)
FEW = (EXPERT, SCORE, TRANSFER, IRL.folder, SHOWN.folder, STUDY.baselines[0].folder)
"""One run of each stage."""
Frame = pd.DataFrame


@pytest.fixture(scope="module")
def few(made: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("few")
    assert archive.add(folder, made, FEW, archive.policies_kept(STUDY))
    return folder


@pytest.fixture
def copy(few: Path, tmp_path: Path) -> Path:
    return Path(shutil.copytree(few, tmp_path / "copy"))


def edit(archive_: Path, frame: str, change: Callable[[Frame], Frame]) -> None:
    """Change a frame, and the manifest with it."""
    part = archive_ / "part-0001"
    path = part / f"{frame}.parquet"
    storage.write_parquet(path, change(storage.read_parquet(path)))
    fit_manifest(part, path)


def fit_manifest(part: Path, path: Path) -> None:
    """Give the manifest the checksum of a changed frame."""
    manifest = storage.read_json(part / "manifest.json")
    storage.write_json(part / "manifest.json", manifest | {"files": {**manifest["files"], path.name: _sum(path)}})


def _sum(path: Path) -> str:
    return digest_of(path.read_bytes())


def put(archive_: Path, folder: str, name: str, content: str) -> None:
    """Give a run another text, with the checksums in its index and its identity."""
    _text(archive_, folder, name, content)
    if name != FILE:
        texts = storage.read_parquet(archive_ / "part-0001" / "texts.parquet")
        own = texts[(texts["folder"] == folder) & (texts["file"] == FILE)]
        record = parse_record(own["content"].iloc[0], folder)
        files = {**record.files, name: digest_of(content.encode())}
        _text(archive_, folder, FILE, dumps(replace(record, files=files)))


def _text(archive_: Path, folder: str, name: str, content: str) -> None:
    texts = {"folder": folder, "file": name, "content": content}
    index = {"folder": folder, "file": name, "sha256": digest_of(content.encode()), "kept": True, "columns": ""}
    edit(archive_, "texts", lambda rows: with_row(rows, texts))
    edit(archive_, "files", lambda rows: with_row(rows, index))


def with_row(rows: Frame, row: dict[str, Any]) -> Frame:
    others = rows[(rows["folder"] != row["folder"]) | (rows["file"] != row["file"])]
    return pd.concat([others, pd.DataFrame([row])], ignore_index=True)


def text_of(archive_: Path, folder: str, name: str) -> str:
    texts = storage.read_parquet(archive_ / "part-0001" / "texts.parquet")
    return str(texts[(texts["folder"] == folder) & (texts["file"] == name)]["content"].iloc[0])


def refused(archive_: Path, said: str, out: Path) -> None:
    """Verify has lines that say it, and unpack writes nothing."""
    wrong = archive.verify(archive_)
    assert wrong
    assert any(said in line for line in wrong), wrong
    assert all(len(line.splitlines()) == 1 for line in wrong)
    with pytest.raises(UserError):
        archive.unpack(archive_, out)
    assert not out.exists()


# --- names that lead elsewhere ----------------------------------------------------------------------------------------

NAMES = (
    "../../../../away.yaml",
    "/tmp/away.yaml",
    "policies/../../away.json",
    "own.json",
    "provenance.json/..",
    "a\nb",
)


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("how", ["in the identity too", "in the index", "in texts alone"])
def test_a_file_that_no_run_of_the_stage_leaves_is_refused(copy, tmp_path, name, how):
    if how == "in the identity too":
        put(copy, EXPERT, name, "{}")
    elif how == "in the index":
        _text(copy, EXPERT, name, "{}")
    else:
        edit(copy, "texts", lambda rows: with_row(rows, {"folder": EXPERT, "file": name, "content": "{}"}))
    refused(copy, f"{name!r} is no file that a run of 'train_expert' leaves", tmp_path / "out" / "deep")
    assert not list(tmp_path.rglob("away*"))


@pytest.mark.parametrize("frame", ["points", "weights"])
def test_contents_under_foreign_names_are_refused(copy, tmp_path, frame):
    def change(rows: Frame) -> Frame:
        return pd.concat([rows, rows.iloc[:1].assign(file="../more.parquet")], ignore_index=True)

    edit(copy, frame, change)
    refused(copy, "'../more.parquet' is no file", tmp_path / "out")


@pytest.mark.parametrize("folder", ["../../away", "/tmp/away", "expert/../../away", "expert//x", "", "expert/./x", "."])
def test_a_folder_outside_the_results_is_refused(copy, tmp_path, folder):
    for frame in ("texts", "files", "evaluation", "curve", "weights"):
        edit(copy, frame, lambda rows: rows.assign(folder=rows["folder"].replace(EXPERT, folder)))
    refused(copy, f"{folder!r}: no folder below the results", tmp_path / "out" / "deep")
    assert not list(tmp_path.rglob("away"))


def test_a_folder_of_dots_that_fits_a_pattern_is_refused(copy, tmp_path):
    folder = EXPERT.replace("/velocity/", "/../")
    for frame in ("texts", "files", "evaluation", "curve"):
        edit(copy, frame, lambda rows: rows.assign(folder=rows["folder"].replace(EXPERT, folder)))
    refused(copy, "no folder below the results", tmp_path / "out")


def test_every_file_of_a_run_is_one_that_its_stage_leaves(made):
    for run in STUDY:
        record = read_record(made / run.folder)
        assert record is not None
        assert all(leaves(run.stage, name) for name in record.files), run.folder
    for stage in OUTPUTS:
        for name in (*NAMES, FILE, "provenance.json", "archived.json", "policies/../x.json", "policies/a/b.json", ""):
            assert not leaves(stage, name)
    assert not leaves("another", "curve.csv")


@pytest.mark.parametrize("name", ["../away.json", "curve.csv/../../away.json"])
def test_add_reads_nothing_outside_the_folder_of_a_run(made, tmp_path, name):
    results = Path(shutil.copytree(made, tmp_path / "again"))
    (results / EXPERT / name).resolve().write_text("{}")
    record = read_record(results / EXPERT)
    assert record is not None
    (results / EXPERT / FILE).write_text(dumps(replace(record, files={**record.files, name: digest_of(b"{}")})))
    with pytest.raises(UserError, match=r"no kind of file that the archive knows|no finished run"):
        add(tmp_path / "archive", results)
    assert not list((tmp_path / "archive").iterdir())


@pytest.mark.parametrize("name", ["settings.json", "gate.json"])
def test_a_run_without_one_of_its_files_is_refused(copy, tmp_path, name):
    record = parse_record(text_of(copy, EXPERT, FILE), EXPERT)
    files = {one: sha for one, sha in record.files.items() if one != name}
    _text(copy, EXPERT, FILE, dumps(replace(record, files=files)))
    for frame in ("texts", "files"):
        edit(copy, frame, lambda rows: rows[(rows["folder"] != EXPERT) | (rows["file"] != name)])
    refused(copy, f"{EXPERT}/{name}: not in files", tmp_path / "out")


# --- numbers that were edited -----------------------------------------------------------------------------------------


def _not_kept(folder: str, name: str) -> Callable[[Frame], Frame]:
    return lambda rows: rows.assign(kept=rows["kept"] & ~((rows["folder"] == folder) & (rows["file"] == name)))


KEPT = [(EXPERT, "evaluation.csv"), (TRANSFER, "curve.csv"), (SCORE, "scores.csv"), (IRL.folder, "reward.safetensors")]


@pytest.mark.parametrize(("folder", "name"), [*KEPT, (SCORE, "points.parquet"), (EXPERT, "gate.json")])
def test_what_an_archive_keeps_cannot_be_said_not_to_be_kept(copy, tmp_path, folder, name):
    if name == "evaluation.csv":
        edit(copy, "evaluation", lambda rows: rows.assign(value=rows["value"].where(rows["folder"] != folder, 0.0)))
    edit(copy, "files", _not_kept(folder, name))
    refused(copy, f"{folder}/{name}: said not to be kept, which an archive does", tmp_path / "out")


def test_what_an_archive_never_keeps_cannot_be_said_to_be_kept(copy, tmp_path):
    def change(rows: Frame) -> Frame:
        return rows.assign(kept=rows["kept"] | ((rows["folder"] == IRL.folder) & (rows["file"] == "samples.parquet")))

    edit(copy, "files", change)
    refused(copy, "samples.parquet: said to be kept, which an archive does not", tmp_path / "out")


def test_weights_of_a_policy_that_is_not_kept_are_not_there(copy, tmp_path):
    expert = STUDY.experts[0].folder if STUDY.experts[0].folder not in archive.policies_kept(STUDY) else ""
    assert expert

    def change(rows: Frame) -> Frame:
        return pd.concat([rows, rows.iloc[:1].assign(folder=expert, file="policy.safetensors")], ignore_index=True)

    edit(copy, "weights", change)
    refused(copy, "said not to be kept, but its content is there", tmp_path / "out")


@pytest.mark.parametrize("frame", ["evaluation", "scores", "diagnostics"])
def test_rows_of_a_file_that_a_run_does_not_have_are_refused(copy, tmp_path, frame):
    folder = SHOWN.folder
    edit(copy, frame, lambda rows: pd.concat([rows, rows.iloc[:1].assign(folder=folder)], ignore_index=True))
    refused(copy, f"{folder}: rows in {frame} of a file", tmp_path / "out")


def test_text_that_is_no_text_is_refused(copy, tmp_path):
    """Parquet says that it is UTF-8; nothing looks until a cell is asked for."""
    path = copy / "part-0001" / "texts.parquet"
    table = pq.read_table(path)
    bad = pa.array([b"\xff\xfe"] * len(table), pa.binary()).view(pa.string())
    pq.write_table(table.set_column(table.column_names.index("content"), "content", bad), path)
    fit_manifest(path.parent, path)
    refused(copy, "not a readable Parquet file", tmp_path / "out")


def test_rows_of_no_run_are_refused(copy, tmp_path):
    edit(copy, "curve", lambda rows: pd.concat([rows, rows.iloc[:1].assign(folder="expert/x")], ignore_index=True))
    refused(copy, "expert/x: no rows of an archive (they lack its files)", tmp_path / "out")


def test_a_column_beside_those_of_the_file_is_refused(copy, tmp_path):
    edit(copy, "evaluation", lambda rows: rows.assign(better=1.0))
    refused(copy, f"{EXPERT}: columns in evaluation that evaluation.csv does not have", tmp_path / "out")


def test_verify_says_what_nothing_holds(copy, capsys):
    """Thinned diagnostics can be edited; the words say so."""
    edit(copy, "diagnostics", lambda rows: rows.assign(value=0.5))
    assert cli.main(["archive", "verify", "--archive", str(copy)]) == 0
    said = capsys.readouterr().out
    assert "nothing holds: the rows of 1 diagnostics.csv" in said
    assert "in the gates of 1 demonstrations" in said


# --- gates, keys, settings, inputs ------------------------------------------------------------------------------------


def _flip(gate: dict[str, Any]) -> None:
    gate["passed"] = not gate["passed"]


def _soften(gate: dict[str, Any]) -> None:
    gate["limits"] = {**gate["limits"], "success": 0.1}


def _succeed(gate: dict[str, Any]) -> None:
    gate["success"] = 0.25


def _flip_member(gate: dict[str, Any]) -> None:
    gate["members"][1]["passed"] = not gate["members"][1]["passed"]


def _forget_members(gate: dict[str, Any]) -> None:
    del gate["members"]


GATED = {run.stage: run.folder for run in STUDY if run.folder in FEW and "gate.json" in OUTPUTS[run.stage]}
FORGED = [(stage, change) for stage in GATED for change in (_flip, _soften)]
FORGED += [("train_expert", _succeed), ("transfer", _succeed), ("learn_reward", _succeed)]
FORGED += [("learn_reward", _flip_member), ("learn_reward", _forget_members)]


@pytest.mark.parametrize(("stage", "change"), FORGED)
def test_a_gate_that_does_not_follow_from_the_episodes_is_refused(copy, tmp_path, stage, change):
    folder = GATED[stage]
    gate = json.loads(text_of(copy, folder, "gate.json"))
    change(gate)
    put(copy, folder, "gate.json", json.dumps(gate, indent=2, sort_keys=True) + "\n")
    refused(copy, f"{folder}/gate.json: ", tmp_path / "out")
    assert len(archive.verify(copy)) == 1


def test_a_gate_of_an_extension_that_is_not_loaded_is_passed_over(copy, monkeypatch):
    """Its metrics are not measured, or one more is; a metric of every study may not be missing."""
    part = archive.frames(copy / "part-0001")
    files, rows = archive.files_of(by_folder(part)[EXPERT]), by_folder(part)[EXPERT]["evaluation"]
    identity = parse_record(files[FILE].decode(), EXPERT).identity
    other = replace(identity, key={**identity.key, "cs_reward": "of_an_extension"})
    assert list(faults_of_gate(other, files, rows)) == []
    monkeypatch.setattr(verdicts, "metrics", lambda: (*metrics(), "of_an_extension"))
    assert list(faults_of_gate(identity, files, rows)) == []
    assert list(faults_of_gate(identity, files, rows[rows["metric"] != "success"])) != []


@pytest.mark.parametrize("content", ["[]", "7", "{}", "{", "[" * 100_000, '{"gate": "expert"}', '{"success": "x"}'])
def test_a_gate_that_is_none_is_one_line(copy, tmp_path, content):
    put(copy, SHOWN.folder, "gate.json", content)
    refused(copy, f"{SHOWN.folder}/gate.json: not a readable gate", tmp_path / "out")


@pytest.mark.parametrize("old_and_new", [("/push-back-t0/", "/push-t0/"), ("/s0", "/s3"), ("-t0/", "-t7/")])
def test_rows_under_the_folder_of_another_run_are_refused(copy, tmp_path, old_and_new):
    other = TRANSFER.replace(*old_and_new)
    assert other != TRANSFER
    for frame in ("texts", "files", "evaluation", "curve"):
        edit(copy, frame, lambda rows: rows.assign(folder=rows["folder"].replace(TRANSFER, other)))
    refused(copy, f"{other}: another run's, by its identity", tmp_path / "out")


def test_a_folder_of_another_stage_is_refused(copy, tmp_path):
    for frame in ("texts", "files", "evaluation", "curve"):
        edit(copy, frame, lambda rows: rows.assign(folder=rows["folder"].replace(TRANSFER, "sac/push-t0/s0")))
    refused(copy, "sac/push-t0/s0: no folder of a run of transfer", tmp_path / "out")


def test_a_run_under_another_method_is_named_by_its_reward(copy):
    other = TRANSFER.replace("/mt_csirl/", "/mt_airl/")
    for frame in ("texts", "files", "evaluation", "curve"):
        edit(copy, frame, lambda rows: rows.assign(folder=rows["folder"].replace(TRANSFER, other)))
    (line,) = archive.verify(copy)
    assert f"{other}: names irl/" in line
    assert "as its reward, which belongs to other runs" in line


def test_settings_are_those_of_the_identity(copy, tmp_path):
    said = json.loads(text_of(copy, EXPERT, "settings.json"))
    said["gates"]["success"] = 0.1
    put(copy, EXPERT, "settings.json", json.dumps(said, indent=2, sort_keys=True) + "\n")
    refused(copy, f"{EXPERT}/settings.json: another gates.success than in its identity", tmp_path / "out")


def test_an_input_that_no_longer_fits_the_archived_run_is_named(copy):
    policy = json.loads(text_of(copy, IRL.folder, "reward.json")) | {"offset": 1.0}
    put(copy, IRL.folder, "reward.json", json.dumps(policy))
    wrong = archive.verify(copy)
    readers = [run.folder for run in STUDY if run.folder in FEW and IRL in run.needs.values()]
    assert TRANSFER in readers
    assert sorted(wrong) == sorted(
        f"{copy}: {folder}: its reward had other bytes than the archive's {IRL.folder}" for folder in readers
    )


# --- malformed parts: one line each -----------------------------------------------------------------------------------


def _without(column: str) -> Callable[[Frame], Frame]:
    return lambda rows: rows.drop(columns=column)


def _with(**cells: Any) -> Callable[[Frame], Frame]:
    return lambda rows: rows.assign(**cells)


MALFORMED: dict[str, tuple[str, Callable[[Frame], Frame], str]] = {
    **{f"files without {name}": ("files", _without(name), f"lacks the column {name}") for name in ("folder", "file")},
    **{f"files without {name}": ("files", _without(name), f"column {name}") for name in ("sha256", "kept", "columns")},
    "files twice": ("files", lambda rows: pd.concat([rows, rows.iloc[:1]]), "a file stands twice in files"),
    "files empty": ("files", lambda rows: rows.iloc[:0], "they lack its files"),
    "files without a run": ("files", lambda rows: rows[rows["folder"] != EXPERT], "they lack its files"),
    "none kept": ("files", _with(kept=False), "said not to be kept"),
    "kept null": ("files", _with(kept=None), "column kept holds a cell that is no bool"),
    "kept text": ("files", _with(kept="yes"), "column kept holds a cell that is no bool"),
    "texts without file": ("texts", _without("file"), "lacks the column file"),
    "texts without content": ("texts", _without("content"), "lacks the column content"),
    "texts of numbers": ("texts", _with(content=3), "column content holds a cell that is no str"),
    "texts of nothing": ("texts", _with(content=None), "column content holds a cell that is no str"),
    "texts twice": ("texts", lambda rows: pd.concat([rows, rows.iloc[:1]]), "a file stands twice in texts"),
    "no identities": ("texts", lambda rows: rows[rows["file"] != FILE], "they lack its identity.json"),
    "one more column": ("texts", _with(more=1), "column 'more' does not belong there"),
    "weights that fit nothing": ("weights", _with(rest=b"xx"), "they do not make files"),
    "weights of texts": ("weights", _with(rest="abc"), "column rest holds a cell that is no bytes"),
    "rows without folder": ("evaluation", _without("folder"), "lacks the column folder"),
    "rows without value": ("evaluation", _without("value"), "evaluation.csv: is not what its run wrote"),
    "rows of texts": ("curve", lambda rows: rows.assign(value=rows["value"].astype(str)), "holds what is no number"),
    "points of numbers": ("points", _with(content=1), "column content holds a cell that is no bytes"),
}


@pytest.mark.parametrize("what", MALFORMED)
def test_a_malformed_part_is_lines_and_nothing_is_unpacked(copy, tmp_path, what, capsys):
    frame, change, said = MALFORMED[what]
    edit(copy, frame, change)
    refused(copy, said, tmp_path / "out")
    for action in ("verify", "unpack", "summary", "draw", "compare"):
        words = ["archive", action, "--archive", str(copy), "--settings", settings(tmp_path / "out").model_dump_json()]
        cli.main(words)
        printed = capsys.readouterr()
        assert "Traceback" not in printed.err
        assert len(printed.err.splitlines()) <= 1 or action == "draw"
    assert not (tmp_path / "out").exists() or action == "draw"


BROKEN = {
    '"files":{': '"files":7,"other":{',
    '"files":{"': '"files":["a"],"other":{"',
    '"read":{': '"read":null,"other":{',
    '"inputs":{': '"inputs":[],"other":{',
    '"settings":{': '"settings":"x","other":{',
    '"stage":"': '"stage":7,"other":"',
    '"format":"mtcsirl identity 1"': '"format":"mtcsirl identity 2"',
}


@pytest.mark.parametrize("old", BROKEN)
def test_a_malformed_identity_is_one_line_with_the_right_way_out(copy, made, tmp_path, old):
    text = text_of(copy, EXPERT, FILE)
    assert old in text
    broken = text.replace(old, BROKEN[old])
    put(copy, EXPERT, FILE, broken)
    refused(copy, "not a readable identity", tmp_path / "out")
    for line in archive.verify(copy):
        assert line.endswith("get this part again from where the archive came from")
    (tmp_path / FILE).write_text(broken)
    with pytest.raises(UserError, match=r"not a readable identity .*; delete its folder and make it again"):
        read_record(tmp_path)


def test_a_lost_manifest_has_the_right_way_out(copy):
    (copy / "part-0001" / "manifest.json").unlink()
    (line,) = archive.verify(copy)
    assert line == f"{copy}/part-0001/manifest.json: lost; get this part again from where the archive came from"
    (copy / "part-0001" / "manifest.json").write_text("[" * 100_000)
    (line,) = archive.verify(copy)
    assert line.endswith(
        "manifest.json: not a readable JSON file; get this part again from where the archive came from"
    )


# --- drafts, strangers, full disks ------------------------------------------------------------------------------------


def test_a_failed_add_leaves_no_draft(made, tmp_path, monkeypatch):
    def full(path: Path, *_: object, **__: object) -> None:
        Path(path).parent.mkdir(parents=True, exist_ok=True)
        raise OSError(errno.ENOSPC, "No space left on device", str(path))

    with monkeypatch.context() as patch:
        patch.setattr(archive.storage, "write_parquet", full)
        with pytest.raises(OSError, match=r"No space left.*part-0001"):
            add(tmp_path / "archive", made)
    assert list((tmp_path / "archive").iterdir()) == []


def test_a_killed_add_leaves_a_draft_that_verify_names_and_the_next_add_removes(made, copy, tmp_path):
    write(STUDY.experts[0], settings(Path(shutil.copytree(made, tmp_path / "new"))), velocity=0.1)
    kill = (
        "import os, signal, sys; from pathlib import Path; import mtcsirl.results.archive as a;"
        "a.os.rename = lambda *_: os.kill(os.getpid(), signal.SIGKILL);"
        "a.add(Path(sys.argv[1]), Path(sys.argv[2]), [sys.argv[3]], [])"
    )
    words = [sys.executable, "-c", kill, str(copy), str(tmp_path / "new"), EXPERT]
    assert subprocess.run(words, check=False, env=dict(os.environ)).returncode == -signal.SIGKILL
    (line,) = archive.verify(copy)
    assert line.startswith(f"{copy}/.part-0002: no part of the archive")
    script = CHECKOUT / "examples" / "read_archive.py"
    counted = [
        subprocess.run([sys.executable, str(script), str(folder)], capture_output=True, text=True, check=True).stdout
        for folder in (copy, shutil.copytree(copy / "part-0001", tmp_path / "only" / "part-0001").parent)
    ]
    assert counted[0] == counted[1], "the example counts parts alone"
    assert archive.add(copy, made, FEW, archive.policies_kept(STUDY)) is None
    assert archive.verify(copy) == []
    assert sorted(path.name for path in copy.iterdir()) == ["part-0001"]


@pytest.mark.parametrize("name", ["part-00002", "part-2", "part-0000", ".part-0007", "part-0001-old", "more"])
def test_strangers_are_named(copy, name):
    shutil.copytree(copy / "part-0001", copy / name)
    (line,) = archive.verify(copy)
    assert line.startswith(f"{copy / name}: no part of the archive")


@pytest.mark.parametrize("name", ["part-0002", "curve.parquet", "identity.json"])
def test_strange_files_are_named(copy, name):
    (copy / name).write_text("x")
    assert archive.verify(copy)[0].startswith(f"{copy / name}: no part of the archive")


def test_a_page_beside_the_parts_is_no_stranger(copy):
    (copy / "README.md").write_text("x")
    storage.write_text(copy / "claims" / "claims.md", "x")
    assert archive.verify(copy) == []


@pytest.mark.parametrize("written", [0, 1, 3])
def test_unpack_on_a_full_disk_names_the_file_and_leaves_no_half_run(copy, tmp_path, monkeypatch, written):
    whole, done = storage.restore, []

    def full(path: Path, data: bytes) -> None:
        if len(done) == written:
            Path(path).parent.mkdir(parents=True, exist_ok=True)
            Path(path).write_bytes(data[: len(data) // 2])
            raise OSError(errno.ENOSPC, "No space left on device")
        done.append(path)
        whole(path, data)

    monkeypatch.setattr(archive.storage, "restore", full)
    with pytest.raises(OSError, match="No space left on device") as error:
        archive.unpack(copy, tmp_path / "out", [EXPERT])
    assert Path(error.value.filename).parent == tmp_path / "out" / EXPERT
    assert [path for path in (tmp_path / "out").rglob("*") if path.is_file()] == []
    monkeypatch.setattr(archive.storage, "restore", whole)
    assert archive.unpack(copy, tmp_path / "out", [EXPERT]).restored == (EXPERT,)


# --- the verb ---------------------------------------------------------------------------------------------------------


def test_verify_and_summary_mind_the_target_and_the_number_of_runs(whole, tmp_path, capsys):
    copy = Path(shutil.copytree(whole, tmp_path / "copy"))
    words = ["--archive", str(copy), "--settings", settings(tmp_path).model_dump_json()]
    everything, own = len(list(STUDY)), 1
    assert cli.main(["archive", "verify", *words, "--runs", str(everything)]) == 0
    assert f"{everything} runs; every kept file" in capsys.readouterr().out
    assert cli.main(["archive", "verify", *words, "--runs", str(everything + 1)]) == 2
    assert f"{everything} runs, not {everything + 1}; get the parts that are missing" in capsys.readouterr().err
    target = ["--target", "table_2"]
    assert cli.main(["archive", "summary", *words, *target]) == 0
    said = capsys.readouterr().out
    for line in said.splitlines():
        if line.endswith(" runs"):
            held, planned = line.split()[1], line.split()[3]
            assert int(held) <= int(planned)
            own += int(held)
    assert f"other runs{'':14}{everything - own + 1:5}" in said
    assert cli.main(["archive", "verify", *words, *target]) == 0
    assert f"{own - 1} runs of {own - 1} of table_2; every kept file" in capsys.readouterr().out
    gate = json.loads(text_of(copy, EXPERT, "gate.json")) | {"success": 0.25}
    put(copy, EXPERT, "gate.json", json.dumps(gate))
    assert cli.main(["archive", "verify", *words]) == 2
