"""The verbs that hand results to other tools: SB3 zip, Minari dataset, video."""

from mtcsirl.commands.arguments import Verbs


def register(verbs: Verbs) -> None:
    """Add the verbs."""
