"""Whether a method of an extension is one: it is built for a small study and asked once for everything it gives."""

from collections.abc import Mapping

import torch

from mtcsirl.extensions import Builder
from mtcsirl.extensions.checks import attempted, check_tensor, must, shown
from mtcsirl.irl.discriminator import Batch, Discriminator, Method
from mtcsirl.irl.methods.base import Setup
from mtcsirl.settings import IrlSettings
from mtcsirl.transitions import Transitions

_TASKS, _ROWS = 2, 3
_SHAPE = (_TASKS, _ROWS)


def check_method(build: Builder) -> None:
    """Build it and hold it against :class:`Method`; nothing is trained, so that what it may share stays as it is.

    Raises:
        UserError: what is wrong, and what it should be.
    """
    with torch.random.fork_rng(devices=[]):
        with attempted("cannot be built", "must build a Method for any Setup"):
            made = build(Setup(IrlSettings(), tasks=_TASKS, seed=0))
        must(isinstance(made, Method), f"builds {shown(made)}", "a function from a Setup to a Method")
        _check_discriminators(made.discriminators)
        _check_policy_reward(made)


def _check_discriminators(discriminators: Mapping[str, Discriminator]) -> None:
    must(isinstance(discriminators, Mapping), f"discriminators = {shown(discriminators)}", "a dict of discriminators")
    held = ", ".join(map(str, discriminators)) or "none"
    must("f" in discriminators, f"discriminators: {held}", "at least one, called 'f', whose reward is kept")
    for name, discriminator in discriminators.items():
        who = f"discriminators[{name!r}]"
        must(isinstance(discriminator, Discriminator), f"{who} is {shown(discriminator)}", "a Discriminator")
        wanted = f"a tensor of shape {list(_SHAPE)} for {_TASKS} tasks of {_ROWS} transitions"
        with attempted(f"{who}: its logit", f"must return {wanted}"):
            logits = discriminator.logits(_batch())
        for logit in logits:
            check_tensor(f"{who}: its logit", logit, _SHAPE, wanted)
    for name, rewards, made_by in (("f", 1, "shared"), ("task", _TASKS, "per_task")):
        found = len(discriminators[name].network.parameters) if name in discriminators else rewards
        must(found == rewards, f"discriminators[{name!r}] has {found} rewards", f"{rewards}, as of Setup.{made_by}")


def _check_policy_reward(made: Method) -> None:
    must(callable(made.policy_reward), f"policy_reward = {shown(made.policy_reward)}", "a function")
    learned = {name: torch.full(_SHAPE, 0.5) for name in made.discriminators}
    given = f"a tensor of shape {list(_SHAPE)} from the task reward, the learned {', '.join(learned)} and alpha"
    with attempted("policy_reward", f"must return {given}"):
        paid = made.policy_reward(torch.ones(_SHAPE), learned, torch.full((_TASKS, 1), 0.5))
    check_tensor("policy_reward", paid, _SHAPE, given)


def _batch() -> Batch:
    """Transitions of ``_SHAPE`` as generators and experts have them, all alike."""
    observation, action = torch.full((*_SHAPE, 39), 0.1), torch.full((*_SHAPE, 4), 0.5)
    one = Transitions(observation, action, observation, torch.ones(_SHAPE))
    return Batch(one, one, torch.zeros(_SHAPE), torch.zeros(_SHAPE), torch.ones(_TASKS, 1))
