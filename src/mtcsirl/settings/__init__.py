"""Frozen, validated settings: the one source of the defaults, the schema and the commented configuration.

The defaults are the desk scale; ``config/config.yaml`` is written from these classes, ``smoke.yaml`` and ``paper.yaml``
are small overlays.
"""

from mtcsirl.settings.budgets import granted
from mtcsirl.settings.configuration import (
    BaselineSettings,
    DemonstrationSettings,
    ExpertSettings,
    MultiTargetSettings,
    MultiTaskSettings,
    Settings,
    SingleTargetSettings,
    TransferStudySettings,
)
from mtcsirl.settings.irl import DiscriminatorSettings, GeneratorSettings, IrlSettings, ScoreSettings, TransferSettings
from mtcsirl.settings.learner import (
    EnvironmentSettings,
    EvaluationSettings,
    GateSettings,
    LearnerSettings,
    ProgressSettings,
    RewardScaleSettings,
    SacSettings,
)

__all__ = [
    "BaselineSettings",
    "DemonstrationSettings",
    "DiscriminatorSettings",
    "EnvironmentSettings",
    "EvaluationSettings",
    "ExpertSettings",
    "GateSettings",
    "GeneratorSettings",
    "IrlSettings",
    "LearnerSettings",
    "MultiTargetSettings",
    "MultiTaskSettings",
    "ProgressSettings",
    "RewardScaleSettings",
    "SacSettings",
    "ScoreSettings",
    "Settings",
    "SingleTargetSettings",
    "TransferSettings",
    "TransferStudySettings",
    "granted",
]
