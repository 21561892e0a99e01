"""Table 5 (tab:single_task_sac_hyperparameters): SAC's hyperparameters, ours beside the paper's."""

from typing import Any

import pandas as pd

from mtcsirl.results.notes import deviation_notes, remarks, study_note
from mtcsirl.results.published import Published, load_published
from mtcsirl.settings import Settings
from mtcsirl.tables.cells import DASH
from mtcsirl.tables.grid import Column, Grid, Line
from mtcsirl.tables.table import Table

CAPTION = "Hyperparameters of SAC: this study's, the paper's, and whether they are the same."
REMARKS = (
    'The paper says "epochs" and "gradient steps per epoch", after a script in which an epoch hides several rollouts. '
    "Here stand environment steps and gradient steps per environment step; the paper's column is the literal product "
    "(500 epochs x 500 steps).",
)


def table_5(rows: pd.DataFrame | None, settings: Settings, published: Published | None = None) -> Table:
    """Build the table from the settings; ``rows`` is not read (all tables share one signature)."""
    entries = _entries(settings, (published or load_published()).hyperparameters)
    lines = [Line(name, (_text(ours), _text(paper), _same(ours, paper))) for name, ours, paper in entries]
    frame = pd.DataFrame(
        [
            {"row": name, "ours": _text(ours), "paper": _text(paper), "same": _same(ours, paper)}
            for name, ours, paper in entries
        ]
    ).assign(scale=settings.scale)
    notes = (study_note(settings), *remarks(REMARKS), *deviation_notes(settings))
    grid = Grid("Description", (Column("ours"), Column("paper"), Column("same")), tuple(lines))
    return Table("table_5", CAPTION, grid, notes, numbers=frame)


def _entries(settings: Settings, paper: dict[str, Any]) -> list[tuple[str, Any, Any]]:
    """(description, ours, paper's); None where one of them has no such thing."""
    sac = settings.sac
    literal = paper["epochs"] * paper["path_length"]
    return [
        ("Batch size (transitions per gradient step)", sac.minibatch, paper["batch_size"]),
        ("Environment steps of the baseline", settings.baseline.steps["default"], literal),
        ("Path length per roll-out", settings.evaluation.episode_steps, paper["path_length"]),
        ("Discount factor", sac.discount, paper["discount"]),
        ("Policy hidden sizes", tuple(sac.hidden_sizes), tuple(paper["hidden_sizes"])),
        (
            "Activation function of hidden layers",
            "ReLU",
            "ReLU" if paper["activation"] == "relu" else paper["activation"],
        ),
        ("Policy learning rate", sac.policy_learning_rate, paper["policy_lr"]),
        ("Q-function learning rate", sac.critic_learning_rate, paper["q_lr"]),
        ("Temperature learning rate", sac.temperature_learning_rate, None),
        ("Policy minimum log standard deviation", sac.min_log_std, paper["min_log_std"]),
        ("Policy maximum log standard deviation", sac.max_log_std, paper["max_log_std"]),
        (
            "Gradient steps per environment step",
            sac.updates_per_step,
            paper["gradient_steps_per_epoch"] / paper["path_length"],
        ),
        ("Soft target interpolation parameter", sac.polyak, paper["tau"]),
        (
            "Automatic entropy tuning (experts, baseline)",
            settings.expert.temperature == settings.baseline.temperature == "automatic",
            paper["automatic_entropy_tuning"],
        ),
        (
            "Automatic entropy tuning (new agents)",
            settings.transfer.temperature == "automatic",
            paper["automatic_entropy_tuning"],
        ),
        (
            "Automatic entropy tuning (generators)",
            settings.irl.temperature == "automatic",
            paper["automatic_entropy_tuning"],
        ),
        ("Factor on the reward (experts, baseline)", settings.baseline.reward_scale, 1.0),
        ("Random steps before training", sac.random_steps, None),
    ]


def _text(value: Any) -> str:
    if value is None:
        return DASH
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, tuple):
        return f"({', '.join(map(str, value))})"
    return f"{value:,}" if isinstance(value, int) else f"{value:g}" if isinstance(value, float) else str(value)


def _same(ours: Any, paper: Any) -> str:
    return "not given" if paper is None else "yes" if ours == paper else "no"
