"""Studies that leave out parts of the paper's design: no table and no figure may fail on them."""

SEEDS = {"seeds": (0, 1), "irl_seeds": (0, 1), "results": "nowhere"}
OTHER_TASKS = {
    "single_target": {"tasks": ("door-open",)},
    "multi_target": {"tasks": ("door-open",), "train_targets": (1,)},
    "multi_task": {"train_tasks": ("drawer-open", "reach"), "train_targets": (3,), "unseen_tasks": ("door-open",)},
}
SUBSETS = {
    "mt_csirl": {"methods": ("mt_csirl",)},
    "mt_csirl_lt": {"methods": ("mt_csirl_lt",)},
    "baseline": {"methods": ("mt_airl",)},
    "velocity": {"cs_rewards": ("velocity",)},
    "action_norm": {"cs_rewards": ("action_norm",)},
    "one_seed": {"seeds": (7,), "irl_seeds": (7,)},
    "tasks": OTHER_TASKS,
    "least": {"methods": ("mt_airl",), "cs_rewards": ("velocity",), "seeds": (3,), "irl_seeds": (3,)} | OTHER_TASKS,
}
"""Changes of the default settings, by name."""


def subset(name: str) -> dict:
    """The settings of a subset as keyword arguments."""
    return SEEDS | SUBSETS[name]
