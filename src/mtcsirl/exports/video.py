"""Videos of stored policies, side by side: GIF with pillow alone, MP4 with imageio-ffmpeg."""

import tempfile
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path

import numpy as np
import PIL.Image
import PIL.ImageDraw
import PIL.ImageFont

from mtcsirl.episodes.policy import Policy, load_policy
from mtcsirl.errors import UserError
from mtcsirl.files import storage
from mtcsirl.names import TARGETS_PER_TASK, TASKS
from mtcsirl.worlds.environments import EPISODE_STEPS, HAND, OBSERVATION_MAPS, STEP_SECONDS, make_environment
from mtcsirl.worlds.rendering import Image, SceneRenderer

STEPS_PER_FRAME = 4
"""Every fourth step makes 20 pictures a second of the robot's own time."""
HEADER = 48
"""Pixels above the picture, for label and numbers."""


@dataclass(frozen=True)
class Clip:
    """One panel: a policy on one task and target, under a label."""

    policy: Policy
    task: str
    target: int
    label: str


def clip_of(
    folder: Path | str, *, task: str | None = None, target: int | None = None, label: str | None = None
) -> Clip:
    """The policy in a run folder; task and target from ``evaluation.csv`` beside it, unless given.

    Raises UserError when there is no readable policy, or task or target is not given and none is written down.
    """
    folder = Path(folder)
    policy = load_policy(folder)
    if task is None or target is None:
        own_task, own_target = _evaluated_on(folder / "evaluation.csv")
        task = own_task if task is None else task
        target = own_target if target is None else target
    return Clip(policy, task, target, label or f"{task}, target {target}")


def _evaluated_on(file: Path) -> tuple[str, int]:
    """Task and target of the first row of an evaluation."""
    rows = storage.read_csv(file, ("task", "target"))
    if rows.empty:
        raise UserError(f"{file}: has no row; say by --task and --target what to show")
    task, target = rows["task"].iloc[0], rows["target"].iloc[0]
    if task not in TASKS or target not in range(TARGETS_PER_TASK):
        raise UserError(f"{file}: task {task!r}, target {target}: no such task and target; give --task and --target")
    return str(task), int(target)


def render_video(
    clips: Sequence[Clip],
    output: Path | str,
    *,
    steps: int = EPISODE_STEPS,
    seed: int | None = 0,
    size: int = 320,
    target_seed: int = 0,
) -> None:
    """Run every clip for ``steps`` environment steps and write them side by side to ``output`` (.gif or .mp4).

    ``seed`` draws the actions of the stochastic policies; None shows their modes. ``size`` is the edge of a panel in
    pixels. The video runs at the robot's own speed.

    Raises:
        UserError: unknown ending, MP4 without imageio-ffmpeg, no OSMesa, no clips, too many steps.
    """
    output = Path(output)
    encode = {".gif": _gif, ".mp4": _mp4}.get(output.suffix.lower())
    if encode is None:
        raise UserError(f"{output}: videos end in .gif or .mp4")
    if not clips:
        raise UserError("video: name at least one folder with a policy")
    if not 1 <= steps <= EPISODE_STEPS:
        raise UserError(f"steps: {steps} is not between 1 and {EPISODE_STEPS}, the length of an episode")
    panels = [clip_frames(clip, steps, seed, size, target_seed) for clip in clips]
    frames = [np.concatenate(parts, axis=1) for parts in zip(*panels, strict=True)]
    storage.write_bytes(output, encode(frames, 1 / (STEPS_PER_FRAME * STEP_SECONDS)))


def clip_frames(clip: Clip, steps: int, seed: int | None, size: int, target_seed: int = 0) -> Iterator[Image]:
    """Pictures [HEADER + size, size, 3] of one clip: the first state, then every fourth step.

    Above each: the label, and the mean speed, mean |a|_1 and success of the episode so far.
    """
    generator = None if seed is None else np.random.default_rng(seed)
    observation_map = OBSERVATION_MAPS[clip.policy.observation]
    environment = make_environment(clip.task, clip.target, observation=clip.policy.observation, target_seed=target_seed)
    observation, _ = environment.reset()
    simulator, edge = environment.simulator, 2 * size  # drawn at twice the size: scaling down smooths the edges
    path, action_norms, solved = [observation_map.invert(observation)[HAND]], [0.0], False
    with SceneRenderer(simulator.model, width=edge, height=edge, fast=True) as renderer:
        for step in range(steps + 1):
            if step % STEPS_PER_FRAME == 0:
                numbers = _numbers(path, action_norms, solved)
                yield _frame(renderer.render(simulator.data), clip.label, numbers, size)
            if step == steps:
                break
            action = clip.policy.act(observation, generator)
            observation, _, _, _, info = environment.step(action)
            path.append(observation_map.invert(observation)[HAND])
            action_norms.append(float(np.abs(action).sum()))
            solved = solved or info["success"]
    environment.close()


def _numbers(path: list[np.ndarray], action_norms: list[float], solved: bool) -> str:
    """Mean speed and action norm so far, and whether the task has been solved."""
    steps = max(len(path) - 1, 1)
    speed = np.linalg.norm(np.diff(path, axis=0), axis=1).sum() / steps / STEP_SECONDS
    return f"{speed:.2f} m/s   |a| {sum(action_norms) / steps:.2f}   {'success' if solved else ''}"


def _frame(picture: Image, label: str, numbers: str, size: int) -> Image:
    """The picture scaled to ``size`` with two lines of text above."""
    frame = PIL.Image.new("RGB", (size, size + HEADER), "white")
    frame.paste(PIL.Image.fromarray(picture).resize((size, size), PIL.Image.Resampling.BOX), (0, HEADER))
    pen = PIL.ImageDraw.Draw(frame)
    pen.text((8, 5), label, fill="black", font=PIL.ImageFont.load_default(15))
    pen.text((8, 26), numbers, fill="#404040", font=PIL.ImageFont.load_default(13))
    return np.asarray(frame)


def _gif(frames: Sequence[Image], rate: float) -> bytes:
    """An endless GIF whose frames share the colours of the middle one, which keeps it small and steady."""
    palette = PIL.Image.fromarray(frames[len(frames) // 2]).quantize(256)
    pictures = [PIL.Image.fromarray(frame).quantize(palette=palette, dither=PIL.Image.Dither.NONE) for frame in frames]
    buffer = BytesIO()
    pictures[0].save(
        buffer, format="GIF", save_all=True, append_images=pictures[1:], duration=round(1000 / rate), loop=0
    )
    return buffer.getvalue()


def _mp4(frames: Sequence[Image], rate: float) -> bytes:
    """H.264 in MP4; ffmpeg writes a file of its own, so it gets a temporary one."""
    try:
        import imageio_ffmpeg
    except ImportError as error:
        raise UserError("MP4 needs imageio-ffmpeg: pip install 'mtcsirl[video]', or ask for a .gif") from error
    height, width = frames[0].shape[:2]
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "video.mp4"
        writer = imageio_ffmpeg.write_frames(str(path), (width, height), fps=rate, macro_block_size=16)
        writer.send(None)
        for frame in frames:
            writer.send(np.ascontiguousarray(frame))
        writer.close()
        return storage.read_bytes(path)
