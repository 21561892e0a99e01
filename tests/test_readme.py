"""The README's numbers of the reference study are the archive's."""

import re
from pathlib import Path

import pytest
from scipy import stats

from mtcsirl.results.archive import archived, read
from mtcsirl.results.statistics import mean_correlation

ROWS = {
    "experts": "expert/{metric}/reach-wall-t0",
    "generators of IRL": "irl/single_target/mt_csirl/{metric}/reach-wall",
    "new agents on the learned reward": "transfer/single_target/mt_csirl/{metric}/reach-wall/reach-wall-t0",
    "SAC": "sac/reach-wall-t0",
}


CORRELATIONS = {
    "one task, velocity": "scores/single_target/mt_csirl/velocity/reach-wall/reach-wall-t0",
    "one task, action norm": "scores/single_target/mt_csirl/action_norm/reach-wall/reach-wall-t0",
    "six tasks, action norm": "scores/multi_task/mt_csirl/action_norm/all/reach-wall-t0",
}
"""The words before each r in the README, and the folder of its scores."""


def correlations(text: str) -> dict[str, str]:
    """As in ``0.78 [0.72, 0.83]``, by the words before it."""
    words = "|".join(CORRELATIONS)
    return dict(re.findall(rf"({words}) (\d\.\d\d \[-?\d\.\d\d, \d\.\d\d\])", " ".join(text.split())))


def correlations_from_archive(archive: Path) -> dict[str, str]:
    """The mean over seeds of Pearson's r on the transitions of plain SAC."""
    rows = read(archive, "scores").query("statistic == 'pearson' and reward == 'learned' and transitions == 'sac'")
    found = {}
    for words, folder in CORRELATIONS.items():
        own = mean_correlation(rows[rows["folder"].str.startswith(folder)]["value"])
        assert own.n == 5, f"{words}: n = 5"
        found[words] = f"{own.value:.2f} [{own.low:.2f}, {own.high:.2f}]"
    return found


def cells(text: str) -> dict[str, list[str]]:
    """The table's rows by their first cell."""
    rows = [[cell.strip() for cell in line.strip("|").split("|")] for line in text.splitlines() if line[:2] == "| "]
    return {first: rest for first, *rest in rows if first in ROWS}


def from_archive(archive: Path) -> dict[str, list[str]]:
    """What the rows must say: mean over seeds with its t-interval, and mean success, for each cs-reward."""
    rows = read(archive, "evaluation").query("policy == 'stochastic' and kept == 'kept'")
    means = rows.groupby(["folder", "metric"])["value"].mean().unstack()
    found: dict[str, list[str]] = {name: [] for name in ROWS}
    for name, pattern in ROWS.items():
        for metric in ("velocity", "action_norm"):
            own = means[means.index.str.fullmatch(re.escape(pattern.format(metric=metric)) + r"/s\d+")]
            assert len(own) == 5, f"{name}: n = 5"
            low, high = stats.t.interval(0.95, 4, own[metric].mean(), stats.sem(own[metric]))
            found[name] += [f"{own[metric].mean():.2f} [{low:.2f}, {high:.2f}]", f"{own['success'].mean():.2f}"]
    return found


def test_its_table_says_what_the_archive_says(checkout: Path) -> None:
    text = (checkout / "README.md").read_text(encoding="utf-8")
    assert cells(text) == from_archive(checkout / "results" / "reference")
    assert correlations(text) == correlations_from_archive(checkout / "results" / "reference")
    assert f"{len(archived(checkout / 'results' / 'reference'))} of its 1,111 runs" in text


@pytest.mark.parametrize("changed", [("0.82 [", "0.83 ["), ("| 0.86 |", "| 1.00 |")])
def test_a_changed_number_is_noticed(checkout: Path, changed: tuple[str, str]) -> None:
    text = (checkout / "README.md").read_text(encoding="utf-8").replace(*changed, 1)
    assert cells(text) != from_archive(checkout / "results" / "reference")


@pytest.mark.parametrize("changed", [("0.27 [0.00", "0.87 [0.00"), ("[0.09, 0.27]", "[0.08, 0.27]")])
def test_a_changed_correlation_is_noticed(checkout: Path, changed: tuple[str, str]) -> None:
    text = (checkout / "README.md").read_text(encoding="utf-8").replace(*changed, 1)
    assert correlations(text) != correlations_from_archive(checkout / "results" / "reference")
