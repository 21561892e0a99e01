"""A trained actor on its own: small, immutable, without torch's machinery when it acts."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import torch
from torch import Tensor

from mtcsirl import storage
from mtcsirl.errors import UserError

FORMAT = "mtcsirl policy 1"


@dataclass(frozen=True)
class Policy:
    """A squashed Gaussian actor with ReLU layers x W^T + b; the last layer gives (mu, log_std).

    weights[l] [out, in] and biases[l] [out], float32 on the cpu; `observation` says what it was trained on.
    """

    weights: tuple[Tensor, ...]
    biases: tuple[Tensor, ...]
    min_log_std: float = -20.0
    max_log_std: float = 2.0
    observation: str = "mapped"
    _layers: tuple[tuple[np.ndarray, np.ndarray], ...] = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        """Keep numpy views of the weights: acting on one observation is three small products."""
        pairs = zip(self.weights, self.biases, strict=True)
        object.__setattr__(self, "_layers", tuple((w.numpy().T, b.numpy()) for w, b in pairs))

    def head(self, observation: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """(mu, log_std) [..., 4] of observations [..., 39]."""
        hidden = np.asarray(observation, dtype=np.float32)
        for weight, bias in self._layers[:-1]:
            hidden = np.maximum(hidden @ weight + bias, 0.0)
        weight, bias = self._layers[-1]
        mean, log_std = np.split(hidden @ weight + bias, 2, axis=-1)
        return mean, np.clip(log_std, self.min_log_std, self.max_log_std)

    def tensors(self) -> dict[str, Tensor]:
        """Weights and biases by name."""
        weights = {f"weight_{layer}": tensor for layer, tensor in enumerate(self.weights)}
        return weights | {f"bias_{layer}": tensor for layer, tensor in enumerate(self.biases)}

    def with_tensors(self, tensors: dict[str, Tensor]) -> Policy:
        """A policy of the same kind with the weights that `tensors` gave."""
        layers = range(len(self.weights))
        return replace(
            self,
            weights=tuple(tensors[f"weight_{layer}"] for layer in layers),
            biases=tuple(tensors[f"bias_{layer}"] for layer in layers),
        )

    def act(self, observation: np.ndarray, generator: np.random.Generator | None = None) -> np.ndarray:
        """Actions [..., 4] for observations [..., 39]: a sample drawn from `generator`, without one the mode."""
        mean, log_std = self.head(observation)
        if generator is not None:
            mean = mean + np.exp(log_std) * generator.standard_normal(mean.shape, dtype=np.float32)
        return np.tanh(mean)


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

    Raises UserError when a file is missing, damaged or of another kind.
    """
    description_file, tensor_file = (Path(folder) / f"{name}{end}" for end in (".json", ".safetensors"))
    description, tensors = storage.read_json(description_file), storage.read_tensors(tensor_file)
    if not isinstance(description, dict) or description.get("format") != FORMAT:
        raise UserError(f"{description_file}: not a policy description; expected format {FORMAT!r}")
    sizes = description["sizes"]
    shapes = [(fan_out, fan_in) for fan_in, fan_out in pairwise(sizes)]
    expected: dict[str, tuple[int, ...]] = {f"weight_{layer}": shape for layer, shape in enumerate(shapes)}
    expected |= {f"bias_{layer}": (size,) for layer, size in enumerate(sizes[1:])}
    found = {key: tuple(tensor.shape) for key, tensor in tensors.items()}
    if found != expected or any(tensor.dtype != torch.float32 for tensor in tensors.values()):
        raise UserError(f"{tensor_file}: its tensors do not fit {description_file.name}; train the agent again")
    layers = range(len(sizes) - 1)
    return Policy(
        weights=tuple(tensors[f"weight_{layer}"] for layer in layers),
        biases=tuple(tensors[f"bias_{layer}"] for layer in layers),
        min_log_std=description["min_log_std"],
        max_log_std=description["max_log_std"],
        observation=description["observation"],
    )
