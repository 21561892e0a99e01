"""The README's numbers of the reference study are the archive's."""

import re
from pathlib import Path

import pytest
from scipy import stats

from mtcsirl.results.archive import archived, read

ROWS = {
    "experts": "expert/{metric}/reach-wall-t0",
    "generators of IRL": "irl/single_target/mt_csirl/{metric}/reach-wall",
    "new agents on the learned reward": "transfer/single_target/mt_csirl/{metric}/reach-wall/reach-wall-t0",
    "SAC": "sac/reach-wall-t0",
}


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
    assert f"{len(archived(checkout / 'results' / 'reference'))} of its 1,111 runs" in text


@pytest.mark.parametrize("changed", [("0.82 [", "0.83 ["), ("| 0.86 |", "| 1.00 |")])
def test_a_changed_number_is_noticed(checkout: Path, changed: tuple[str, str]) -> None:
    text = (checkout / "README.md").read_text(encoding="utf-8").replace(*changed, 1)
    assert cells(text) != from_archive(checkout / "results" / "reference")
