"""The ablations as data: which settings each variant changes, and which agents it trains.

An ablation is a target of its own (`snakemake ablation_replay`) and no part of `all`. Its first variant changes nothing
and shares the main study's runs; those of the others land under `results/ablations/<ablation>/<variant>/`.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal

Agent = Literal["expert", "irl", "transfer"]


@dataclass(frozen=True)
class Variant:
    """One way to do it; ``changes`` are settings by section, as in an overlay."""

    label: str
    changes: Mapping[str, Mapping[str, Any]]
    agents: tuple[Agent, ...] | None = None
    """Which agents it trains anew; None: all of its ablation. Others are those of the first variant."""


@dataclass(frozen=True)
class Ablation:
    """What is compared, on the tasks, seeds and cs-reward of the section ``ablations``."""

    question: str
    agents: tuple[Agent, ...]
    """Whose results are shown. ``irl``: MT-CSIRL on each task alone; ``transfer``: new agents on its reward."""
    variants: Mapping[str, Variant]


ABLATIONS: dict[str, Ablation] = {
    "ablation_replay": Ablation(
        "Does the reward transfer because the discriminator sees old generator samples?",
        ("irl", "transfer"),
        {
            "default": Variant("replay, density of the mixture", {}),
            "latest": Variant("latest rollout, as printed", {"irl": {"generator_replay": 1}}),
            "newest_density": Variant("replay, density of the newest", {"irl": {"logit_density": "as_printed"}}),
        },
    ),
    "ablation_temperature": Ablation(
        "Must the temperature be fixed at 1, in the generators and in new agents?",
        ("irl", "transfer"),
        {
            "default": Variant("as configured", {}),
            "automatic": Variant("generators: automatic", {"irl": {"temperature": "automatic"}}),
            "fixed_transfer": Variant(
                "new agents: that of IRL", {"transfer": {"temperature": 1.0, "reward_scale": 1.0}}, ("transfer",)
            ),
        },
    ),
    "ablation_curriculum": Ablation(
        "Does the main task suffer without the curriculum?",
        ("expert", "irl"),
        {
            "default": Variant("curriculum", {}),
            "constant": Variant("constant weight", {"expert": {"curriculum": False}, "irl": {"curriculum": False}}),
            "task_maximum": Variant("curriculum, maximum 10", {"irl": {"curriculum_maximum": "task"}}, ("irl",)),
        },
    ),
    "ablation_observation": Ablation(
        "Can an agent learn a speed from Meta-World's raw observation?",
        ("expert",),
        {
            "default": Variant("as configured (mapped)", {}),
            "raw": Variant("raw", {"environment": {"observation": "raw"}}),
        },
    ),
}


def prefix(variant: str) -> str:
    """The folder, below the results, of the runs of ``variant`` as in ``ablation_replay/latest``; main study: none."""
    return f"ablations/{variant}/" if variant else ""


def changes(variant: str) -> Mapping[str, Mapping[str, Any]]:
    """The settings that ``variant`` changes."""
    if not variant:
        return {}
    ablation, _, name = variant.partition("/")
    return ABLATIONS[ablation].variants[name].changes
