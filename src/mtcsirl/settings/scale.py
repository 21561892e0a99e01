"""What a scale promises: ``paper`` every number that the paper gives, whatever part of its design a study runs."""

from mtcsirl.errors import UserError
from mtcsirl.settings.configuration import Settings
from mtcsirl.settings.template import deviations

DESIGN = ("seeds", "irl_seeds", "cs_rewards", "methods", "single_target.", "multi_target.", "multi_task.")
"""Which runs exist: a part of the paper's design, or other tasks, is still at its scale."""


def check_scale(settings: Settings) -> None:
    """Raise UserError where ``scale`` is paper and a value that decides a run's numbers is not the paper's.

    Tables, figures and verdicts print the scale; printed above desk values, "paper" would be false.
    """
    if settings.scale != "paper":
        return
    others = [deviation for deviation in deviations(settings) if not deviation.key.startswith(DESIGN)]
    if others:
        first = f"{others[0].key} = {others[0].ours!r}, in the paper {others[0].paper!r}"
        more = f" (and {len(others) - 1} more)" if len(others) > 1 else ""
        raise UserError(
            f"configuration: scale = 'paper', but {first}{more}; take config/paper.yaml as it is, or set scale to desk,"
            " which promises no values"
        )
