"""A learned reward as an artefact: what IRL leaves behind and new agents train on."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import torch
from torch import Tensor

from mtcsirl.errors import UserError
from mtcsirl.files import storage
from mtcsirl.rewards.networks import RewardNetwork
from mtcsirl.transitions import RewardFunction, Transitions

FORMAT = "mtcsirl learned reward 1"
WEIGHTS, DESCRIPTION = "reward.safetensors", "reward.json"


@dataclass(frozen=True)
class LearnedReward:
    """f(s, a, s') = network - offset, frozen; called on transitions [...] it gives rewards [...].

    ``observation`` names the observation map it was trained on and ``members`` the (task, target) pairs whose
    demonstrations it saw. MT-CSIRL+LT has ``task_network`` beside f: one task reward per member.
    """

    network: RewardNetwork
    method: str
    cs_reward: str
    observation: str
    members: tuple[tuple[str, int], ...]
    offset: float = 0.0
    task_network: RewardNetwork | None = None
    task_offsets: tuple[float, ...] = ()
    about: dict[str, Any] = field(default_factory=dict)
    """Anything else worth keeping in the description, such as experiment, source and seed."""

    @property
    def experiment(self) -> str:
        """The experiment that it was learned in; where it does not say, what its members make of it."""
        tasks = {task for task, _ in self.members}
        told = "single_target" if len(self.members) == 1 else "multi_target" if len(tasks) == 1 else "multi_task"
        return str(self.about.get("experiment", told))

    @property
    def source(self) -> str:
        """The task that it was learned from, or "all"; where it does not say, what its members make of it."""
        tasks = sorted({task for task, _ in self.members})
        return str(self.about.get("source", tasks[0] if len(tasks) == 1 else "all"))

    def to(self, device: torch.device | str) -> "LearnedReward":
        """A copy that computes on another device."""
        task = None if self.task_network is None else self.task_network.to(device)
        return replace(self, network=self.network.to(device), task_network=task)

    def __call__(self, transitions: Transitions) -> Tensor:
        """The learned reward f [...] of transitions [...]."""
        return self.network(transitions) - self.offset

    def task_reward(self, task: str, target: int) -> RewardFunction:
        """The learned task reward of one (task, target) pair of MT-CSIRL+LT.

        Raises:
            UserError: the method learns no task rewards, or the pair was not among its tasks.
        """
        if self.task_network is None:
            raise UserError(f"method {self.method!r} learns no task reward; mt_csirl_lt does")
        if (task, target) not in self.members:
            known = ", ".join(f"{name}-t{index}" for name, index in self.members)
            raise UserError(f"no learned task reward for {task}-t{target}; this run has {known}")
        index = self.members.index((task, target))
        network, offset = self.task_network.member(index), self.task_offsets[index]
        return lambda transitions: network(transitions) - offset


def save_learned_reward(reward: LearnedReward, folder: Path | str) -> None:
    """Write ``reward.safetensors`` (weights) and ``reward.json`` (architecture, origin, checksum) into ``folder``."""
    folder = Path(folder)
    networks = {"f": reward.network} | ({"task": reward.task_network} if reward.task_network else {})
    storage.write_tensors(folder / WEIGHTS, {name: network.parameters for name, network in networks.items()})
    storage.write_json(
        folder / DESCRIPTION,
        {
            "format": FORMAT,
            "method": reward.method,
            "cs_reward": reward.cs_reward,
            "observation": reward.observation,
            "members": [list(member) for member in reward.members],
            "networks": {name: network.architecture for name, network in networks.items()},
            "offset": reward.offset,
            "task_offsets": list(reward.task_offsets),
            "sha256": storage.checksum(folder / WEIGHTS),
            "about": reward.about,
        },
    )


def load_learned_reward(folder: Path | str) -> LearnedReward:
    """Read a reward that ``save_learned_reward`` wrote.

    Raises:
        UserError: a file is missing, truncated, changed since it was written, of another kind, or holds a number that
            is not finite.
    """
    weights, description = Path(folder) / WEIGHTS, Path(folder) / DESCRIPTION
    said = storage.read_json(description)
    if not isinstance(said, dict) or said.get("format") != FORMAT:
        raise UserError(f"{description}: not the description of a learned reward; expected format {FORMAT!r}")
    tensors = storage.read_tensors(weights)
    if storage.checksum(weights) != said.get("sha256"):
        raise UserError(f"{weights}: differs from the checksum in {DESCRIPTION}; learn the reward again")
    broken = sorted(name for name, tensor in tensors.items() if not tensor.isfinite().all())
    if broken:
        raise UserError(f"{weights}: {', '.join(broken)} holds numbers that are not finite; learn the reward again")
    try:
        members = tuple((str(task), int(target)) for task, target in said["members"])
        networks = _networks(said["networks"], tensors, len(members))
        return LearnedReward(
            network=networks["f"],
            method=said["method"],
            cs_reward=said["cs_reward"],
            observation=said["observation"],
            members=members,
            offset=_finite(said["offset"]),
            task_network=networks.get("task"),
            task_offsets=_offsets(said["task_offsets"], len(members) if "task" in networks else 0),
            about=said["about"],
        )
    except (KeyError, TypeError, ValueError) as error:
        raise UserError(f"{description}: does not describe {WEIGHTS} ({error}); learn the reward again") from error


def check_learned(
    learned: LearnedReward,
    folder: Path | str,
    *,
    cs_reward: str | None = None,
    observation: str | None = None,
    method: str | None = None,
    experiment: str | None = None,
) -> None:
    """Refuse a reward from ``folder`` that is another than is asked for; what is None may be anything.

    Raises:
        UserError: it was learned from experts of another cs-reward, on other observations, by another method or in
            another experiment.
    """
    if cs_reward is not None and learned.cs_reward != cs_reward:
        raise UserError(f"{folder}: learned from {learned.cs_reward} experts; ask for --cs-reward {learned.cs_reward}")
    if observation is not None and learned.observation != observation:
        raise UserError(
            f"{folder}: learned on {learned.observation!r} observations; set environment.observation to that"
        )
    if method is not None and learned.method != method:
        raise UserError(f"{folder}: learned by {learned.method}, not by {method}; give the folder of that one's reward")
    if experiment is not None and learned.experiment != experiment:
        raise UserError(
            f"{folder}: learned in the experiment {learned.experiment}, not in {experiment}; give that one's folder"
        )


def _finite(value: Any) -> float:
    number = float(value)
    if not math.isfinite(number):
        raise ValueError(f"{value} is not finite")
    return number


def _networks(
    architectures: dict[str, dict[str, Any]], tensors: dict[str, Tensor], members: int
) -> dict[str, RewardNetwork]:
    expected: Sequence[tuple[str, int]] = (("f", 1), ("task", members))
    found = {name: tensors[name] for name, _ in expected if name in architectures}
    if set(found) != set(tensors) or any(name in found and len(found[name]) != count for name, count in expected):
        raise ValueError("its tensors are of another run")
    return {name: RewardNetwork.from_parameters(architectures[name], tensor) for name, tensor in found.items()}


def _offsets(values: Sequence[float], expected: int) -> tuple[float, ...]:
    if len(values) != expected:
        raise ValueError(f"{len(values)} task offsets instead of {expected}")
    return tuple(_finite(value) for value in values)
