"""The verb that renders stored policies."""

import argparse
from pathlib import Path

from mtcsirl.commands.arguments import Verbs, add_verb, new_file, path, positive, seed, target, target_seed, task
from mtcsirl.errors import UserError

EDGES = (64, 1024)


def register(verbs: Verbs) -> None:
    """Add the verb."""
    verb = add_verb(
        verbs,
        "video",
        _video,
        does="render stored policies side by side",
        needs="run folders with policy.safetensors, policy.json and (without --task) evaluation.csv; Debian's "
        "libosmesa6; imageio-ffmpeg for MP4",
        writes="the file --output, a GIF or MP4",
    )
    verb.add_argument("folders", nargs="+", type=path, metavar="FOLDER", help="run folder of an expert, SAC, ...")
    verb.add_argument("--output", required=True, type=film, metavar="FILE", help="ends in .gif or .mp4")
    verb.add_argument("--label", action="append", default=[], metavar="TEXT", help="one per folder, in their order")
    verb.add_argument("--task", type=task, metavar="TASK", help="another task than the one that was trained on")
    verb.add_argument("--target", type=target, metavar="INDEX", help="another target than the one that was trained on")
    verb.add_argument("--steps", type=positive, default=500, help="environment steps, at most 500")
    verb.add_argument("--seed", type=seed, default=0, help="draws the actions of the stochastic policies")
    verb.add_argument("--deterministic", action="store_true", help="show the modes of the policies instead")
    verb.add_argument("--size", type=_edge, default=320, help=f"edge of a panel in pixels, {EDGES[0]} to {EDGES[1]}")
    verb.add_argument("--target-seed", type=target_seed, default=0, help="seed of Meta-World's targets")


def _video(parsed: argparse.Namespace) -> None:
    from mtcsirl.exports.video import clip_of, render_video

    if parsed.label and len(parsed.label) != len(parsed.folders):
        raise UserError(f"--label: {len(parsed.label)} labels for {len(parsed.folders)} folders; give one per folder")
    labels = parsed.label or [None] * len(parsed.folders)
    clips = [
        clip_of(folder, task=parsed.task, target=parsed.target, label=label)
        for folder, label in zip(parsed.folders, labels, strict=True)
    ]
    seed = None if parsed.deterministic else parsed.seed
    render_video(clips, parsed.output, steps=parsed.steps, seed=seed, size=parsed.size, target_seed=parsed.target_seed)
    print(parsed.output)


def film(given: str) -> Path:
    """The file of a video."""
    file = new_file(given)
    if file.suffix.lower() not in (".gif", ".mp4"):
        raise UserError(f"{file}: videos end in .gif or .mp4")
    return file


def _edge(given: str) -> int:
    pixels = positive(given)
    if not EDGES[0] <= pixels <= EDGES[1]:
        raise argparse.ArgumentTypeError(f"{given!r}: must be {EDGES[0]} to {EDGES[1]}")
    return pixels
