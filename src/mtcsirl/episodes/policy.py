"""A trained actor on its own: small, immutable, without torch's machinery when it acts."""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import torch
from torch import Tensor

from mtcsirl.errors import UserError
from mtcsirl.files import storage
from mtcsirl.worlds.environments import OBSERVATION_MAPS

FORMAT = "mtcsirl policy 1"


@dataclass(frozen=True)
class Policy:
    """A squashed Gaussian actor with ReLU layers x W^T + b; the last layer gives (mu, log_std).

    weights[l] [out, in] and biases[l] [out], float32; `observation` says what it was trained on. Plain numpy: acting
    on one observation is three small products, and the policy goes to another process as it is.
    """

    weights: tuple[np.ndarray, ...]
    biases: tuple[np.ndarray, ...]
    min_log_std: float = -20.0
    max_log_std: float = 2.0
    observation: str = "mapped"

    def head(self, observation: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """(mu, log_std) [..., 4] of observations [..., 39]."""
        hidden = np.asarray(observation, dtype=np.float32)
        for weight, bias in zip(self.weights[:-1], self.biases[:-1], strict=True):
            hidden = np.maximum(hidden @ weight.T + bias, 0.0)
        mean, log_std = np.split(hidden @ self.weights[-1].T + self.biases[-1], 2, axis=-1)
        return mean, np.clip(log_std, self.min_log_std, self.max_log_std)

    def tensors(self) -> dict[str, Tensor]:
        """Weights and biases by name."""
        weights = {f"weight_{layer}": torch.from_numpy(array) for layer, array in enumerate(self.weights)}
        return weights | {f"bias_{layer}": torch.from_numpy(array) for layer, array in enumerate(self.biases)}

    def with_tensors(self, tensors: dict[str, Tensor]) -> Policy:
        """A policy of the same kind with the weights that `tensors` gave."""
        layers = range(len(self.weights))
        return replace(
            self,
            weights=tuple(tensors[f"weight_{layer}"].numpy() for layer in layers),
            biases=tuple(tensors[f"bias_{layer}"].numpy() for layer in layers),
        )

    def act(self, observation: np.ndarray, generator: np.random.Generator | None = None) -> np.ndarray:
        """Actions [..., 4] for observations [..., 39]: a sample drawn from `generator`, without one the mode."""
        mean, log_std = self.head(observation)
        if generator is not None:
            mean = mean + np.exp(log_std) * generator.standard_normal(mean.shape, dtype=np.float32)
        action: np.ndarray = np.tanh(mean)
        return action


def finite_action(
    policy: Policy, observation: np.ndarray, generator: np.random.Generator | None, where: str
) -> np.ndarray:
    """The policy's action [4], which ``where`` (whose policy, which step) names if it is no number.

    MuJoCo resets itself when it is given NaN, and the arm falls: a policy of NaN would close a drawer.

    Raises:
        UserError: an entry of the action is not finite.
    """
    action = policy.act(observation, generator)
    if not np.isfinite(action).all():
        raise UserError(f"{where}: the action {action.tolist()} is not finite; train the agent again")
    return action


def save_policy(policy: Policy, folder: Path | str, name: str = "policy") -> None:
    """Write `<name>.safetensors` (weights) and `<name>.json` (shapes, bounds, observation) into `folder`."""
    folder = Path(folder)
    storage.write_tensors(folder / f"{name}.safetensors", policy.tensors())
    storage.write_json(
        folder / f"{name}.json",
        {
            "format": FORMAT,
            "sizes": [policy.weights[0].shape[1], *(weight.shape[0] for weight in policy.weights)],
            "min_log_std": policy.min_log_std,
            "max_log_std": policy.max_log_std,
            "observation": policy.observation,
        },
    )


def load_policy(folder: Path | str, name: str = "policy") -> Policy:
    """Read a policy that `save_policy` wrote.

    Raises UserError when a file is missing, damaged, of another kind or holds a number that is not finite.
    """
    description_file, tensor_file = (Path(folder) / f"{name}{end}" for end in (".json", ".safetensors"))
    sizes, bounds, observation = _description(description_file)
    tensors = storage.read_tensors(tensor_file)
    expected = {f"bias_{layer}": (size,) for layer, size in enumerate(sizes[1:])} | {
        f"weight_{layer}": (fan_out, fan_in) for layer, (fan_in, fan_out) in enumerate(pairwise(sizes))
    }
    found = {key: tuple(tensor.shape) for key, tensor in tensors.items()}
    if found != expected or any(tensor.dtype != torch.float32 for tensor in tensors.values()):
        raise UserError(f"{tensor_file}: its tensors do not fit {description_file.name}; train the agent again")
    broken = sorted(key for key, tensor in tensors.items() if not torch.isfinite(tensor).all())
    if broken:
        raise UserError(f"{tensor_file}: {', '.join(broken)} hold numbers that are not finite; train the agent again")
    layers = range(len(sizes) - 1)
    weights = tuple(tensors[f"weight_{layer}"].numpy() for layer in layers)
    biases = tuple(tensors[f"bias_{layer}"].numpy() for layer in layers)
    return Policy(weights, biases, *bounds, observation)


def _description(file: Path) -> tuple[list[int], tuple[float, float], str]:
    """Layer sizes, log_std bounds and observation map of a stored policy."""
    said = storage.read_json(file)
    if not isinstance(said, dict) or said.get("format") != FORMAT:
        raise UserError(f"{file}: not a policy description; expected format {FORMAT!r}")
    try:
        sizes = [int(size) for size in said["sizes"]]
        bounds = float(said["min_log_std"]), float(said["max_log_std"])
        if not np.isfinite(bounds).all():
            raise ValueError(f"bounds {bounds} of log_std")
        OBSERVATION_MAPS[said["observation"]]
    except (KeyError, TypeError, ValueError) as error:
        raise UserError(f"{file}: does not describe a policy ({error}); train the agent again") from error
    return sizes, bounds, said["observation"]
