"""Names of Meta-World's tasks as data, so that validating a configuration imports no simulator.

The paper omits the version suffix (section 5); Meta-World 3 calls them ``<task>-v3``. A test holds this list
against the installed Meta-World.
"""

TASKS: tuple[str, ...] = (
    "assembly",
    "basketball",
    "bin-picking",
    "box-close",
    "button-press-topdown",
    "button-press-topdown-wall",
    "button-press",
    "button-press-wall",
    "coffee-button",
    "coffee-pull",
    "coffee-push",
    "dial-turn",
    "disassemble",
    "door-close",
    "door-lock",
    "door-open",
    "door-unlock",
    "hand-insert",
    "drawer-close",
    "drawer-open",
    "faucet-open",
    "faucet-close",
    "hammer",
    "handle-press-side",
    "handle-press",
    "handle-pull-side",
    "handle-pull",
    "lever-pull",
    "pick-place-wall",
    "pick-out-of-hole",
    "pick-place",
    "plate-slide",
    "plate-slide-side",
    "plate-slide-back",
    "plate-slide-back-side",
    "peg-insert-side",
    "peg-unplug-side",
    "soccer",
    "stick-push",
    "stick-pull",
    "push",
    "push-wall",
    "push-back",
    "reach",
    "reach-wall",
    "shelf-place",
    "sweep-into",
    "sweep",
    "window-open",
    "window-close",
)

TARGETS_PER_TASK = 50
"""Meta-World draws 50 targets (variations) per task; a target is an index into them."""

KEPT, LAST = "kept", "last"
"""Which policy of a training a row of an evaluation is about: the one that the run leaves behind, or the last."""

DIVERGED = "diverged"
"""The metric that is 1 in an episode whose simulation diverged, else 0."""


def distance_metric(cs_reward: str) -> str:
    """The metric E|m - target| of a cs-reward's measure m: minus its mean unweighted ground-truth reward."""
    return f"{cs_reward}_distance"
