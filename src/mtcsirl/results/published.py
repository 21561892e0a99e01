"""The paper's own numbers, in this suite's units: m/s, |a|_1, success as a share."""

from collections.abc import Iterable
from functools import cache
from importlib import resources
from typing import Any

import numpy as np
import yaml

from mtcsirl.errors import UserError
from mtcsirl.results.statistics import Summary

PAPER_ORDER = ("action_norm", "velocity")
RATIO_TABLES = {"action_norm": "table_1", "velocity": "table_3"}
NOT_PRINTED = Summary(np.nan, np.nan, 0)
"""What the paper does not print."""


def in_paper_order(cs_rewards: Iterable[str]) -> tuple[str, ...]:
    """cs-rewards as the paper orders its columns and panels, any others behind them."""
    given = tuple(cs_rewards)
    return (*(cs for cs in PAPER_ORDER if cs in given), *(cs for cs in given if cs not in PAPER_ORDER))


class Published:
    """Look-ups by table; a number comes as mean, sd (NaN where none is printed) and number of seeds.

    What the paper does not report, for example for a task or cs-reward of one's own, is ``NOT_PRINTED``.
    """

    def __init__(self, data: dict[str, Any]) -> None:
        self.data = data
        self.seeds: int = data["seeds"]

    def cross_transfer(self, cs_reward: str, source: str, task: str) -> Summary:
        """Tables 1 and 3: metric / target of new agents on ``task`` with the reward learned on ``source``."""
        table = self.data.get(RATIO_TABLES.get(cs_reward, ""), {"tasks": []})
        if source not in table["tasks"] or task not in table["tasks"]:
            return NOT_PRINTED
        row, column = table["tasks"].index(source), table["tasks"].index(task)
        return self._summary(table["ratio"][row][column], None)

    def cross_baseline(self, cs_reward: str, task: str) -> Summary:
        """Tables 1 and 3, in parentheses: metric / target of plain SAC on ``task``."""
        table = self.data.get(RATIO_TABLES.get(cs_reward, ""), {"tasks": []})
        if task not in table["tasks"]:
            return NOT_PRINTED
        return self._summary(table["diagonal_sac_baseline"][table["tasks"].index(task)], None)

    def unseen(self, agent: str, cs_reward: str, metric: str) -> Summary:
        """Table 2: ``metric`` (the cs-reward's own, or success) of ``agent`` on unseen tasks."""
        cell = self.data["table_2"]["rows"].get(agent, {}).get(cs_reward)
        return self._of(cell, metric, {"success": ("success", "success_sd"), cs_reward: ("mean", "sd")})

    def learned_task(self, task: str, cs_reward: str, metric: str) -> Summary:
        """Table 4: ``metric`` (the ratio of the cs-reward's metric to its target, or success) on ``task``."""
        cell = self.data["table_4"]["rows"].get(task, {}).get(cs_reward)
        return self._of(cell, metric, {"success": ("success", "success_sd"), cs_reward: ("ratio", "")})

    def correlation(self, experiment: str, cs_reward: str) -> Summary:
        """Figures 2c, 3c and 7: Pearson's r of learned and true cs-reward; one number, no seeds given."""
        found = {
            ("single_target", "velocity"): self.data["figure_2"]["c_correlation"]["velocity"],
            ("multi_task", "velocity"): self.data["figure_3"]["c_correlation"]["velocity"],
            ("multi_task", "action_norm"): self.data["figure_7"]["correlation"]["action_norm"],
        }.get((experiment, cs_reward))
        return NOT_PRINTED if found is None else Summary(float(found), np.nan, 1)

    @property
    def hyperparameters(self) -> dict[str, Any]:
        """Table 5."""
        return dict(self.data["table_5"])

    def _of(self, cell: dict[str, float] | None, metric: str, names: dict[str, tuple[str, str]]) -> Summary:
        if cell is None or metric not in names:
            return NOT_PRINTED
        mean, sd = (cell.get(name) for name in names[metric])
        if mean is None:
            return NOT_PRINTED
        percent = 0.01 if metric == "success" else 1.0
        return self._summary(percent * mean, None if sd is None else percent * sd)

    def _summary(self, mean: float, sd: float | None) -> Summary:
        return Summary(float(mean), np.nan if sd is None else float(sd), self.seeds)


@cache
def load_published() -> Published:
    """The paper's numbers as shipped with the package."""
    text = resources.files("mtcsirl.results").joinpath("published.yaml").read_text(encoding="utf-8")
    data = yaml.safe_load(text)
    if not isinstance(data, dict):
        raise UserError("results/published.yaml: not a mapping; install the package again")
    return Published(data)
