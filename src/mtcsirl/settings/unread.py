"""Keys that a kind of run shares with others but does not read.

They stay at their defaults in its settings, so that a change elsewhere makes no such run stale, and whoever sets one
for a single run is told so. A test trains every kind of run and holds this list against what changes its results.
"""

from collections.abc import Iterable, Mapping
from functools import cache
from typing import Any, TypeVar

from pydantic import BaseModel

from mtcsirl.errors import UserError
from mtcsirl.settings.sources import Sources, holder

Model = TypeVar("Model", bound=BaseModel)

_OF_CS_REWARD = (
    "cs_weight",
    "curriculum",
    "curriculum_window",
    "curriculum_maximum",
    "warm_up_success",
    "warm_up_episodes",
    "warm_up_steps",
)
_OF_SELECTION = ("progress.select_every", "progress.select_episodes", "progress.select_training_episodes")
_OF_EXPERT_GATE = ("gates.expert_velocity", "gates.expert_action_norm")
_OF_AGENT = ("sac.updates_per_step", "progress.tensorboard")
_OF_PERCEPTRON = ("irl.discriminator.hidden_sizes", "irl.discriminator.gradient_penalty")
_OF_BOTTLENECK = (
    "irl.discriminator.bottleneck_hidden_sizes",
    "irl.discriminator.bottleneck_size",
    "irl.discriminator.information_constraint",
    "irl.discriminator.initial_beta",
    "irl.discriminator.beta_step",
)
_OF_VAIRL_GP = ("irl.discriminator.vairl_gradient_penalty",)
_OF_KNOWN_REWARD = ("irl.task_reward_scale", "irl.warm_up_temperature", "scripted_steps", "scripted_noise")
_OF_CURRICULUM = ("irl.curriculum", "irl.curriculum_window", "irl.curriculum_maximum", "irl.cs_weight")
_OF_LEARNED_TASK = ("irl.unknown_task_curriculum",)
_OF_ENTIRE_REWARD = (*_OF_KNOWN_REWARD, *_OF_CURRICULUM, *_OF_LEARNED_TASK)
METHODS: dict[str, tuple[str, ...]] = {
    "mt_airl": (*_OF_ENTIRE_REWARD, *_OF_BOTTLENECK, *_OF_VAIRL_GP),
    "mt_vairl": (*_OF_ENTIRE_REWARD, *_OF_PERCEPTRON, *_OF_VAIRL_GP),
    "mt_vairl_gp": (*_OF_ENTIRE_REWARD, *_OF_PERCEPTRON),
    "mt_csirl": (*_OF_LEARNED_TASK, *_OF_BOTTLENECK, *_OF_VAIRL_GP),
    "mt_csirl_lt": (*_OF_KNOWN_REWARD, *_OF_BOTTLENECK, *_OF_VAIRL_GP),
}
"""By method; one of an extension is taken to read everything."""
EVALUATE = ("environment.target_seed", "evaluation.episodes", "evaluation.episode_steps")
"""All that the evaluation of a stored policy reads: what it sees is in its own file."""


def unread(stage: str, *, cs_reward: str = "", method: str = "") -> tuple[str, ...]:
    """Dotted keys that a run of ``stage`` does not read."""
    own_gate = f"gates.expert_{cs_reward}" if f"gates.expert_{cs_reward}" in _OF_EXPERT_GATE else _OF_EXPERT_GATE[0]
    others = tuple(key for key in _OF_EXPERT_GATE if key != own_gate)
    if stage == "train_sac":
        return (*_OF_CS_REWARD, *_OF_EXPERT_GATE, "gates.generator")
    if stage == "train_expert":
        return (*others, "gates.generator")
    if stage == "collect_demonstrations":
        return (*others, "environment.observation", "gates.generator")  # stored raw, seen as the expert's file says
    if stage == "transfer":
        return (*_OF_SELECTION, *_OF_EXPERT_GATE, "gates.generator")
    if stage == "learn_reward":
        return (*_OF_SELECTION, *_OF_EXPERT_GATE, *_OF_AGENT, *METHODS.get(method, ()))
    return ()


def sliced(settings: Model, keys: Iterable[str]) -> Model:
    """``settings`` with ``keys`` at their defaults."""
    for key in keys:
        settings = _with_default(settings, key.split("."))
    return settings


def refuse(settings: BaseModel, keys: Iterable[str], who: str, sources: Sources = ()) -> None:
    """Raise UserError where one of ``keys`` is not at its default: ``who`` does not read it."""
    for key in keys:
        value, default = _get(settings, key), _get(type(settings)(), key)
        if value != default:
            where = holder(key, sources)
            raise UserError(f"{where}: {key} = {value!r}: {who} does not read this key; leave it out")


def refuse_others(given: Mapping[str, Any], read: Iterable[str], who: str, prefix: str = "") -> None:
    """Raise UserError where the assignments ``given`` by --set hold a key that is not among those ``read``."""
    for name, value in given.items():
        key = f"{prefix}{name}"
        if key in read:
            continue
        if not isinstance(value, Mapping):
            raise UserError(f"--set: {key} = {value!r}: {who} does not read this key, only {', '.join(read)}")
        refuse_others(value, read, who, f"{key}.")


def _with_default(settings: Any, parts: list[str]) -> Any:
    name, *rest = parts
    own = getattr(settings, name)
    model: type[BaseModel] = type(settings)
    default = getattr(_defaults(model), name)
    return settings.model_copy(update={name: _with_default(own, rest) if rest else default})


@cache
def _defaults(model: type[BaseModel]) -> BaseModel:
    return model()


def _get(settings: Any, key: str) -> Any:
    for name in key.split("."):
        settings = getattr(settings, name)
    return settings
