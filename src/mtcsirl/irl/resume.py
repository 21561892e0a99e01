"""The state of an IRL run between two iterations, as named tensors: what an exact resume needs."""

from collections.abc import Mapping
from functools import partial

import torch
from torch import Tensor

from mtcsirl.files.checkpoint import prefixed, without_prefix
from mtcsirl.irl.trainer import IrlTrainer


def state(trainer: IrlTrainer) -> dict[str, Tensor]:
    """Everything but the rows in ``curve`` and ``diagnostics``."""
    parts: dict[str, dict[str, Tensor]] = {
        "densities": trainer.densities.state(),
        "trainer": {"random": trainer.random.get_state(), "iteration": torch.tensor(trainer.iteration)},
    }
    parts |= {f"discriminator_{name}": one.state() for name, one in trainer.method.discriminators.items()}
    for generator in range(len(trainer.world.members)):
        parts[f"sac_{generator}"] = trainer.sac.state_dict(generator)
        parts[f"replay_{generator}"] = trainer.replay.state_dict(generator)
        parts[f"curriculum_{generator}"] = trainer.alpha.state_dict(generator)
    return {name: tensor for part, state in parts.items() for name, tensor in prefixed(part, state).items()}


def load_state(trainer: IrlTrainer, state: Mapping[str, Tensor]) -> None:
    """Restore what ``state`` gave."""
    part = partial(without_prefix, tensors=dict(state))
    own = part("trainer")
    trainer.start_at(int(own["iteration"]))
    trainer.densities.load_state(part("densities"))
    trainer.random.set_state(own["random"])
    for name, discriminator in trainer.method.discriminators.items():
        discriminator.load_state(part(f"discriminator_{name}"))
    for generator in range(len(trainer.world.members)):
        trainer.sac.load_state_dict(generator, part(f"sac_{generator}"))
        trainer.replay.load_state_dict(generator, part(f"replay_{generator}"))
        trainer.alpha.load_state_dict(generator, part(f"curriculum_{generator}"))
