"""Commands that several tests give."""

from pathlib import Path


def learn_reward(*demonstrations: Path | str, method: str = "mt_csirl", seed: int = 0) -> list[str]:
    """``mtcsirl learn-reward`` for the velocity over files of demonstrations, without settings and output."""
    key = ["--method", method, "--cs-reward", "velocity", "--seed", str(seed)]
    return ["learn-reward", *key, "--demonstrations", *map(str, demonstrations)]
