"""What a run needs of the machine it runs on: a device that is there, memory that suffices.

Not a matter of the configuration alone: the machine that plans a study on a cluster is not the one that trains.
"""

import os
from collections.abc import Sequence
from itertools import pairwise

from mtcsirl.errors import UserError
from mtcsirl.settings.configuration import Settings
from mtcsirl.settings.learner import LearnerSettings
from mtcsirl.settings.runs import AgentRunSettings, IrlRunSettings

STATE, ACTION, NUMBER = 39, 4, 4
"""Numbers in an observation and in an action; bytes of a number."""
COPIES = {"actor": 4, "critic": 10}
"""Parameters, gradients and Adam's two moments; two critics, and a target of each without gradients and moments."""


def check_agent(run: AgentRunSettings) -> None:
    """Raise UserError, one line, where this machine cannot train the agent."""
    check_device(run.sac.device)
    _check_memory({"sac.hidden_sizes": _networks(run.sac), "steps": _replay(run.steps)})


def check_irl(run: IrlRunSettings, generators: int) -> None:
    """Raise UserError, one line, where this machine cannot run an IRL of so many generators."""
    irl = run.irl
    held = min(irl.generator_memory, (irl.iterations + irl.warm_up_iterations) * irl.steps_per_iteration)
    check_device(run.sac.device)
    sizes = irl.discriminator
    widest = max(
        _weights(2 * STATE + ACTION, layers, 1) for layers in (sizes.hidden_sizes, sizes.bottleneck_hidden_sizes)
    )
    _check_memory(
        {
            "sac.hidden_sizes": generators * _networks(run.sac),
            "irl.discriminator.hidden_sizes": COPIES["actor"] * NUMBER * widest,
            "irl.generator_memory": generators * _replay(held),
        }
    )


def check_study(settings: Settings) -> None:
    """Raise UserError, one line, where this machine cannot train one agent of the study."""
    check_device(settings.sac.device)
    budgets = {name: max(getattr(settings, name).steps.values()) for name in ("expert", "baseline", "transfer")}
    needs = {"sac.hidden_sizes": _networks(settings.sac)}
    needs |= {f"{name}.steps": _replay(steps) for name, steps in budgets.items()}
    _check_memory(needs)


def check_device(device: str) -> None:
    """Raise UserError where a CUDA device is asked for and not there; imports torch only then."""
    if device == "cpu":
        return
    import torch

    index = int(device.partition(":")[2] or 0)
    if index >= torch.cuda.device_count():
        found = f"has {torch.cuda.device_count()} CUDA devices" if torch.cuda.is_available() else "has no CUDA device"
        raise UserError(f"configuration: sac.device = {device!r}: this machine {found}; set it to cpu")


def _check_memory(needs: dict[str, float]) -> None:
    """The parts of one process and their bytes, of which the greatest is named."""
    there = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    if sum(needs.values()) > there:
        name = max(needs, key=lambda part: needs[part])
        gib = sum(needs.values()) / 2**30
        raise UserError(
            f"configuration: {name}: a run would need {gib:,.1f} GiB of memory, this machine has {there / 2**30:,.1f};"
            " make it smaller"
        )


def _networks(sac: LearnerSettings) -> float:
    actor = _weights(STATE, sac.hidden_sizes, 2 * ACTION)
    critic = _weights(STATE + ACTION, sac.hidden_sizes, 1)
    return NUMBER * float(COPIES["actor"] * actor + COPIES["critic"] * critic)


def _weights(inputs: int, hidden: Sequence[int], outputs: int) -> int:
    sizes = (inputs, *hidden, outputs)
    return sum((before + 1) * after for before, after in pairwise(sizes))


def _replay(steps: int) -> float:
    """Bytes of so many transitions: s, a, s' and the task reward."""
    return NUMBER * float(steps) * (2 * STATE + ACTION + 1)
