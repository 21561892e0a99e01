"""A stored policy as an ordinary stable-baselines3 file, for those who want one."""

from __future__ import annotations

import io
from pathlib import Path
from typing import Any

import numpy as np
import torch

from mtcsirl import storage
from mtcsirl.agents.policy import load_policy
from mtcsirl.errors import UserError


@torch.no_grad()
def export_sb3(folder: Path | str, file: Path | str, name: str = "policy") -> None:
    """Write the policy in `folder` as a zip that `stable_baselines3.SAC.load` reads.

    The zip holds the trained actor beside fresh critics: enough to act, not to go on training. It says nothing about
    the observation map: the actor expects observations as its `policy.json` says. Such a zip contains pickled
    objects; this package writes it for others and never reads one.

    Raises UserError for a policy whose log_std bounds stable-baselines3 does not have.
    """
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
    weights = [*policy.weights[:-1], *np.split(policy.weights[-1], 2)]
    biases = [*policy.biases[:-1], *np.split(policy.biases[-1], 2)]
    for layer, weight, bias in zip([*hidden, actor.mu, actor.log_std], weights, biases, strict=True):
        layer.weight.copy_(torch.from_numpy(weight))
        layer.bias.copy_(torch.from_numpy(bias))
    buffer = io.BytesIO()
    model.save(buffer)
    storage.write_bytes(file, buffer.getvalue())
