"""Names, labels and units, said once: tasks, methods, cs-rewards and what is measured.

Pure data, so that validating a configuration imports no simulator. The paper omits the version suffix of Meta-World's
tasks (section 5); Meta-World 3 calls them ``<task>-v3``. A test holds ``TASKS`` against the installed Meta-World.
"""

from typing import NamedTuple

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
HIGHEST_TARGET_SEED = 2**32 - 1
"""Meta-World draws the targets with NumPy's old generator, whose seeds have 32 bits."""
HIGHEST_SEED = 2**53 - 1
"""Beyond it a column of numbers in a CSV file cannot tell two seeds apart."""
EVALUATION_TARGET = 0
"""Every result is read on target 0; the IRL of several targets trains on others, so it is new to it."""

SINGLE_TASKS = ("reach-wall", "button-press-topdown-wall", "drawer-close", "push-back", "coffee-button")
"""Sections 5.1 and 5.2."""
TRAIN_TASKS = ("window-open", "reach", "plate-slide", "faucet-open", "coffee-button", "door-close")
UNSEEN_TASKS = ("reach-wall", "button-press-topdown-wall", "drawer-close", "push-back")
"""Sections 5.3 and 5.4: tasks with experts, and tasks on which their reward is tried."""
DESIGN_TASKS = tuple(dict.fromkeys(SINGLE_TASKS + TRAIN_TASKS))
"""The ten tasks of the paper."""
EXPERIMENTS = ("single_target", "multi_target", "multi_task")
METHODS = ("mt_airl", "mt_vairl", "mt_vairl_gp", "mt_csirl", "mt_csirl_lt")
"""The paper's methods, in the order of its Table 2."""
CS_REWARDS = ("velocity", "action_norm")


class Quantity(NamedTuple):
    """What a metric is called, its unit on an axis and, for a cs-reward, the value that is wanted, in that unit."""

    label: str
    unit: str
    target: float | None = None


QUANTITIES = {
    "velocity": Quantity("velocity", "m/s", target=0.8),
    "action_norm": Quantity("action norm", r"$\Vert a\Vert_1$", target=3.0),
    "success": Quantity("success rate", "share of episodes"),
    "task_reward": Quantity("task reward", "per step"),
}
"""The action norm has no unit, so its formula stands there."""

AGENTS = {
    "expert": "Expert",
    "sac": "SAC",
    "irl_agent": "IRL agent",
    "mt_airl": "MT-AIRL",
    "mt_vairl": "MT-VAIRL",
    "mt_vairl_gp": "MT-VAIRL-GP",
    "mt_csirl": "MT-CSIRL",
    "mt_csirl_lt": "MT-CSIRL+LT",
}
"""Labels of the methods and of the agents that they are held against."""


def agent_label(name: str) -> str:
    """How a method or agent is called in a table or figure; one that the suite does not ship keeps its own name."""
    return AGENTS.get(name, name.replace("_", "-").upper())


KEPT, LAST = "kept", "last"
"""Which policy of a training a row of an evaluation is about: the one that the run leaves behind, or the last."""

DIVERGED = "diverged"
"""The metric that is 1 in an episode whose simulation diverged, else 0."""


def distance_metric(cs_reward: str) -> str:
    """The metric E|m - target| of a cs-reward's measure m: minus its mean unweighted ground-truth reward."""
    return f"{cs_reward}_distance"


CURVE_COLUMNS = ("task", "target", "step", "metric", "value")
DIAGNOSTIC_COLUMNS = ("task", "target", "step", "discriminator", "metric", "value")
"""Of an IRL run's curve.csv and diagnostics.csv; rows on the generator have no discriminator."""

KERNELS = "MTCSIRL_KERNELS"
"""The environment variable that asks for the arithmetic of another maker's processor (agents/kernels.py)."""
