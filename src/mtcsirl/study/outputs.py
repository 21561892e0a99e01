"""What each stage leaves in the folder of a run: the outputs that the rules declare and `mtcsirl status` looks for."""

_RUN = ("settings.json", "provenance.json")
_AGENT = ("policy.safetensors", "policy.json", "curve.csv", "evaluation.csv", "gate.json", *_RUN)

OUTPUTS: dict[str, tuple[str, ...]] = {
    "train_expert": _AGENT,
    "train_sac": _AGENT,
    "collect_demonstrations": ("demonstrations.parquet", "gate.json", *_RUN),
    "learn_reward": (
        "reward.safetensors",
        "reward.json",
        "curve.csv",
        "diagnostics.csv",
        "evaluation.csv",
        "gate.json",
        "samples.parquet",
        *_RUN,
    ),
    "transfer": _AGENT,
    "score_reward": ("scores.csv", "points.parquet", *_RUN),
}
"""Files per stage."""
FOLDERS: dict[str, tuple[str, ...]] = {"learn_reward": ("policies/",)}
"""Folders per stage: an IRL run leaves the policies of its generators, one pair of files per (task, target)."""
