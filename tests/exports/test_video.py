"""Videos of a small made-up policy."""

import importlib.util
import re
import shutil

import numpy as np
import pandas as pd
import PIL.Image
import pytest

from mtcsirl.agents.sac import FusedSac
from mtcsirl.cli import main
from mtcsirl.episodes.policy import save_policy
from mtcsirl.errors import UserError
from mtcsirl.exports.video import HEADER, clip_frames, clip_of, render_video
from mtcsirl.settings import SacSettings
from tests.conftest import needs_rendering


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("expert")
    save_policy(FusedSac(1, SacSettings(hidden_sizes=(8,)), seeds=[0]).policy(0), folder)
    pd.DataFrame({"task": ["reach"], "target": [1]}).to_csv(folder / "evaluation.csv", index=False)
    return folder


def test_task_and_target_come_from_the_run(folder):
    clip = clip_of(folder)
    assert (clip.task, clip.target, clip.label) == ("reach", 1, "reach, target 1")
    assert clip_of(folder, task="push-back", target=2, label="SAC").task == "push-back"


@needs_rendering
def test_gif_side_by_side_at_the_robots_speed(folder, tmp_path):
    path = tmp_path / "both.gif"
    arguments = ["video", str(folder), str(folder), "--label", "Expert", "--label", "SAC", "--output", str(path)]
    assert main([*arguments, "--steps", "8", "--size", "128"]) == 0
    with PIL.Image.open(path) as gif:
        assert gif.size == (256, 128 + HEADER)
        assert gif.n_frames == 3
        assert gif.info["duration"] == 50  # 4 steps of 12.5 ms
        picture = np.asarray(gif.convert("RGB"))[HEADER:].astype(int)
    red = (picture[..., 0] > 100) & (picture[..., 1:] < 60).all(axis=-1)
    assert red[:, :128].sum() > 200, "the arm is red"
    assert red[:, 128:].sum() > 200


@needs_rendering
def test_frames_move_and_equal_seeds_give_equal_frames(folder):
    clip = clip_of(folder)
    first, second = (list(clip_frames(clip, 8, 0, 96)) for _ in range(2))
    assert all(np.array_equal(a, b) for a, b in zip(first, second, strict=True))
    assert not np.array_equal(first[0][HEADER:], first[-1][HEADER:])
    modes = list(clip_frames(clip, 8, None, 96))
    assert not np.array_equal(first[-1], modes[-1])


@needs_rendering
@pytest.mark.skipif(importlib.util.find_spec("imageio_ffmpeg") is None, reason="imageio-ffmpeg is not installed")
def test_mp4(folder, tmp_path):
    import imageio_ffmpeg

    path = tmp_path / "one.mp4"
    render_video([clip_of(folder)], path, steps=8, size=96)
    reader = imageio_ffmpeg.read_frames(str(path))
    about = next(reader)
    assert about["size"] == (96, 144)
    assert about["fps"] == pytest.approx(20)
    assert len(list(reader)) == 3


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"output": "film.avi"}, "film.avi: videos end in .gif or .mp4"),
        ({"clips": []}, "name at least one folder"),
        ({"steps": 501}, "steps: 501 is not between 1 and 500"),
    ],
)
def test_mistakes_are_one_line(folder, changes, words):
    arguments = {"clips": [clip_of(folder)], "output": "film.gif"} | changes
    with pytest.raises(UserError, match=re.escape(words)):
        render_video(arguments.pop("clips"), arguments.pop("output"), **arguments)


FOREIGN = {
    "no row": ({"task": [], "target": []}, "evaluation.csv: has no row; say by --task and --target"),
    "no target": ({"task": ["reach"], "target": [None]}, "task 'reach', target nan: no such task and target"),
    "half a target": ({"task": ["reach"], "target": [0.5]}, "target 0.5: no such"),
    "a target too many": ({"task": ["reach"], "target": [50]}, "target 50: no such"),
    "a target below": ({"task": ["reach"], "target": [-1]}, "target -1: no such"),
    "no end": ({"task": ["reach"], "target": ["inf"]}, "target inf: no such"),
    "no task": ({"task": [""], "target": [1]}, "task '', target 1: no such"),
    "an unknown task": ({"task": ["fly"], "target": [1]}, "task 'fly', target 1: no such"),
}


@pytest.mark.parametrize("what", FOREIGN)
def test_an_evaluation_that_names_no_task_and_target_is_one_line(folder, tmp_path, capsys, what):
    columns, says = FOREIGN[what]
    own = tmp_path / "own"
    shutil.copytree(folder, own)
    pd.DataFrame(columns).to_csv(own / "evaluation.csv", index=False)
    assert main(["video", str(own), "--output", str(tmp_path / "x.gif")]) == 2
    error = capsys.readouterr().err
    assert error.count("\n") == 1
    assert says in error
    assert "--task and --target" in error
    assert not (tmp_path / "x.gif").exists()
    assert clip_of(own, task="reach", target=2).target == 2, "who gives both needs no evaluation"


def test_whole_numbers_with_a_point_are_targets(folder, tmp_path):
    shutil.copytree(folder, tmp_path / "own")
    (tmp_path / "own" / "evaluation.csv").write_text("task,target\nreach,49.0\nreach,\n")
    assert clip_of(tmp_path / "own").target == 49


def test_folder_without_policy(tmp_path, capsys):
    assert main(["video", str(tmp_path), "--output", str(tmp_path / "x.gif")]) == 2
    assert capsys.readouterr().err.count("\n") == 1
    assert not (tmp_path / "x.gif").exists()
