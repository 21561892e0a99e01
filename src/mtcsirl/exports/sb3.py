"""A stored policy as an ordinary stable-baselines3 file, for those who want one."""

from __future__ import annotations

import io
from pathlib import Path
from typing import Any

import numpy as np
import torch

from mtcsirl.episodes.policy import Policy, load_policy
from mtcsirl.errors import UserError
from mtcsirl.files import storage
from mtcsirl.worlds.environments import OBSERVATION_MAPS, OBSERVATION_SIZE


@torch.no_grad()
def export_sb3(folder: Path | str, file: Path | str, name: str = "policy") -> None:
    """Write the policy in `folder` as a zip that `stable_baselines3.SAC.load` reads.

    The zip holds the trained actor beside fresh critics: enough to act, not to go on training. The observation map of
    `policy.json` is affine and goes into the first layer, so the model acts on Meta-World's own observations. Such a
    zip contains pickled objects; this package writes it for others and never reads one.

    Raises UserError for a file that does not end in .zip, for stable-baselines3 would add that, and for a policy whose
    log_std bounds stable-baselines3 does not have.
    """
    if Path(file).suffix != ".zip":
        raise UserError(f"{file}: must end in .zip")
    from stable_baselines3 import SAC

    from mtcsirl.agents.reference import Spaces

    policy = load_policy(folder, name)
    if (policy.min_log_std, policy.max_log_std) != (-20.0, 2.0):
        raise UserError(f"{folder}: stable-baselines3 clamps log_std to [-20, 2]; this policy has other bounds")
    sizes = [weight.shape[0] for weight in policy.weights]
    spaces = Spaces(policy.weights[0].shape[1], sizes[-1] // 2)
    model = SAC("MlpPolicy", spaces, buffer_size=1, policy_kwargs={"net_arch": sizes[:-1]}, device="cpu")
    actor: Any = model.actor
    hidden = [layer for layer in actor.latent_pi if isinstance(layer, torch.nn.Linear)]
    first, offset = _on_raw_observations(policy)
    weights = [first, *policy.weights[1:-1], *np.split(policy.weights[-1], 2)]
    biases = [offset, *policy.biases[1:-1], *np.split(policy.biases[-1], 2)]
    for layer, weight, bias in zip([*hidden, actor.mu, actor.log_std], weights, biases, strict=True):
        layer.weight.copy_(torch.from_numpy(weight))
        layer.bias.copy_(torch.from_numpy(bias))
    buffer = io.BytesIO()
    model.save(buffer)
    storage.write_bytes(file, buffer.getvalue())


def _on_raw_observations(policy: Policy) -> tuple[np.ndarray, np.ndarray]:
    """The first layer with the observation map inside: W (A x + c) + b = (W A) x + (W c + b)."""
    see = OBSERVATION_MAPS[policy.observation].apply
    nothing = see(np.zeros(OBSERVATION_SIZE))
    matrix = (see(np.eye(OBSERVATION_SIZE)) - nothing).T
    weight = policy.weights[0].astype(np.float64)
    return (weight @ matrix).astype(np.float32), (weight @ nothing + policy.biases[0]).astype(np.float32)
