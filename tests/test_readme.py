"""The README's numbers of the reference study are the archive's."""

import re
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from scipy import stats

from mtcsirl.results.archive import archived, read
from mtcsirl.results.moments import beyond_task
from mtcsirl.results.points import EPISODE, without_first
from mtcsirl.results.statistics import Estimate, mean_correlation

ALONE = {
    f"{task} alone": f"transfer/single_target/mt_csirl/{{metric}}/{task}/{task}-t0"
    for task in ("reach-wall", "drawer-close", "button-press-topdown-wall", "push-back", "coffee-button")
}
"""The first cell of each row about a reward of one task, and the folders of its new agents."""
UNSEEN = {
    task: f"transfer/multi_task/mt_csirl/{{metric}}/all/{task}-t0"
    for task in ("reach-wall", "button-press-topdown-wall", "drawer-close", "push-back")
}
"""The first cell of each row about MT-CSIRL's reward of six tasks, and the folders of its new agents."""

CORRELATIONS = {
    "one task, velocity": "scores/single_target/mt_csirl/velocity/reach-wall/reach-wall-t0",
    "one task, action norm": "scores/single_target/mt_csirl/action_norm/reach-wall/reach-wall-t0",
    "six tasks, velocity": "scores/multi_task/mt_csirl/velocity/all/reach-wall-t0",
    "six tasks, action norm": "scores/multi_task/mt_csirl/action_norm/all/reach-wall-t0",
}
"""The first cell of each row of the README's correlations, and the folder of its scores."""


def in_words(estimate: Estimate) -> str:
    return f"{estimate.value:.2f} [{estimate.low:.2f}, {estimate.high:.2f}]"


def correlations_from_archive(archive: Path) -> dict[str, list[str]]:
    """r on the transitions of plain SAC, mean over seeds, and the partial r that claims are judged by."""
    pearson = read(archive, "scores").query("statistic == 'pearson' and reward == 'learned' and transitions == 'sac'")
    points = read(archive, "points")
    found = {}
    for words, folder in CORRELATIONS.items():
        own = mean_correlation(pearson[pearson["folder"].str.startswith(folder)]["value"])
        scored = points[points["folder"].str.startswith(folder)]
        scored = scored.assign(seed=scored["folder"].str.rpartition("/s")[2].astype(int))
        judged = beyond_task(without_first(scored, ["folder", *EPISODE]), np.random.default_rng(0)).partial
        assert own.n == judged.n == 5, f"{words}: n = 5"
        found[words] = [in_words(own), in_words(judged)]
    return found


def cells(text: str) -> dict[str, list[str]]:
    """The tables' rows by their first cell, without marks."""
    rows = [[cell.strip(" †") for cell in line.strip("|").split("|")] for line in text.splitlines() if line[:2] == "| "]
    return {first: rest for first, *rest in rows if first in ALONE | UNSEEN}


def correlations(text: str) -> dict[str, list[str]]:
    """The rows of the correlations by their first cell, without the paper's and marks."""
    rows = [[cell.strip(" †") for cell in line.strip("|").split("|")] for line in text.splitlines() if line[:2] == "| "]
    return {first: rest[:2] for first, *rest in rows if first in CORRELATIONS}


def agents_of(archive: Path) -> pd.DataFrame:
    """Mean of each metric of each run's kept stochastic policy [folder, metric]."""
    rows = read(archive, "evaluation").query("policy == 'stochastic' and kept == 'kept'")
    return rows.groupby(["folder", "metric"])["value"].mean().unstack()


def from_archive(archive: Path) -> dict[str, list[str]]:
    """What the rows must say: mean over seeds with its t-interval, and mean success, for each cs-reward."""
    means = agents_of(archive)
    found: dict[str, list[str]] = {name: [] for name in ALONE | UNSEEN}
    for name, pattern in (ALONE | UNSEEN).items():
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


@pytest.mark.parametrize("changed", [("0.82 [", "0.83 ["), ("| 0.96 |", "| 1.00 |")])
def test_a_changed_number_is_noticed(checkout: Path, changed: tuple[str, str]) -> None:
    text = (checkout / "README.md").read_text(encoding="utf-8").replace(*changed, 1)
    assert cells(text) != from_archive(checkout / "results" / "reference")


@pytest.mark.parametrize("changed", [("0.27 [0.00", "0.87 [0.00"), ("[0.22, 0.48]", "[0.23, 0.48]")])
def test_a_changed_correlation_is_noticed(checkout: Path, changed: tuple[str, str]) -> None:
    text = (checkout / "README.md").read_text(encoding="utf-8").replace(*changed, 1)
    assert correlations(text) != correlations_from_archive(checkout / "results" / "reference")


def said_of_claims(text: str) -> dict[str, str]:
    """The verdict in slanted letters after "C7 is", by claim."""
    return dict(re.findall(r"\b(C\d+) is \*([a-z ]+)\*", " ".join(text.split())))


def judged(page: str) -> dict[str, str]:
    """The verdict of each claim in docs/results.md, which `make reference` holds against the archive."""
    return dict(re.findall(r"^\| (C\d+)[^|]*\|.*?\| \*\*([a-z ]+)\*\* \|", page, re.MULTILINE))


def test_its_verdicts_are_those_of_the_results_page(checkout: Path) -> None:
    text = (checkout / "README.md").read_text(encoding="utf-8")
    page = (checkout / "docs" / "results.md").read_text(encoding="utf-8")
    assert said_of_claims(text).items() <= judged(page).items()
    assert said_of_claims(text), "it says what was found"
    experts = re.search(r"(\d+ of \d+) experts pass", " ".join(text.split()))
    assert experts is None or f"{experts[1]} experts passed their gate" in page


def test_another_verdict_is_noticed(checkout: Path) -> None:
    page = (checkout / "docs" / "results.md").read_text(encoding="utf-8")
    assert not said_of_claims("C1 is\n*reproduced* (8 met)").items() <= judged(page).items()


def successes(archive: Path) -> str:
    """What the README must say of the success of new agents on unseen tasks."""
    rows = from_archive(archive)
    velocity, norm = (100 * np.mean([float(rows[task][column]) for task in UNSEEN]) for column in (1, 3))
    return f"they succeed in {velocity:.0f} and {norm:.0f} % of their episodes"


def test_the_share_of_successes_is_the_archives(checkout: Path) -> None:
    text = " ".join((checkout / "README.md").read_text(encoding="utf-8").split())
    assert successes(checkout / "results" / "reference") in text


def test_another_share_is_noticed(checkout: Path) -> None:
    assert successes(checkout / "results" / "reference") not in "they succeed in 99 and 100 % of their episodes"


def marked(text: str) -> set[str]:
    """The units of C3 that the README marks as not judged, as the results page names them."""
    rows = [[cell.strip() for cell in line.strip("|").split("|")] for line in text.splitlines() if line[:2] == "| "]
    cells = {first.removesuffix(" alone"): rest for first, *rest in rows if first in ALONE}
    names = {"velocity": 1, "action norm": 3}
    return {f"{name}, {task}" for task, rest in cells.items() for name, column in names.items() if "†" in rest[column]}


def not_judged(page: str) -> set[str]:
    """The units of C3 whose precondition is not met, from the results page."""
    section = page.partition("### C3:")[2].partition("### C4:")[0]
    return set(re.findall(r"^\| ([^|]+) \| precondition not met \|", section, re.MULTILINE))


def test_it_marks_the_units_that_are_not_judged(checkout: Path) -> None:
    text = (checkout / "README.md").read_text(encoding="utf-8")
    page = (checkout / "docs" / "results.md").read_text(encoding="utf-8")
    assert marked(text) == not_judged(page) != set()
    assert marked(text.replace("| 0.86 † |", "| 0.86 |", 1)) != not_judged(page), "a lost mark is noticed"


def with_both(archive: Path) -> str:
    """How many new agents on one task's rewards have the task and the behaviour."""
    means = agents_of(archive)
    both, every = 0, 0
    for metric, target in (("velocity", 0.8), ("action_norm", 3.0)):
        for pattern in ALONE.values():
            own = means[means.index.str.fullmatch(re.escape(pattern.format(metric=metric)) + r"/s\d+")]
            both += int(((own["success"] >= 0.9) & ((own[metric] - target).abs() <= 0.25 * target)).sum())
            every += len(own)
    return f"{both} of {every} the task too"


def test_the_count_of_agents_with_task_and_behaviour_is_the_archives(checkout: Path) -> None:
    text = " ".join((checkout / "README.md").read_text(encoding="utf-8").split())
    assert with_both(checkout / "results" / "reference") in text
    assert with_both(checkout / "results" / "reference") not in text.replace("36 of 50", "46 of 50")


def of_several_targets(archive: Path) -> list[str]:
    """What findings counts of the agents on velocity rewards of several targets, on their own task and off it."""
    means = agents_of(archive)
    named = r"transfer/multi_target/mt_csirl/velocity/(?P<source>[\w-]+)/(?P<task>[\w-]+)-t0/s\d+"
    key = means.index.to_series().str.extract(f"^{named}$").dropna()
    sac = means["velocity"][means.index.str.startswith("sac/")]
    usual = sac.groupby(sac.index.str.extract(r"sac/([\w-]+)-t0", expand=False)).mean()
    own, base = means.loc[key.index], key["task"].map(usual)
    near, kept = (own["velocity"] - 0.8).abs() <= 0.2, own["success"] >= 0.9
    like_sac = ((own["velocity"] - base).abs() < 0.25 * (0.8 - base)) & kept
    off = key["source"] != key["task"]
    return [
        f"Of the {(~off).sum()} agents {(near & kept & ~off).sum()} succeed in at least 90 %",
        f"Here {(near & off).sum()} of {off.sum()} are within 25 % of the target, {(kept & off).sum()} of {off.sum()} "
        f"succeed and {(near & kept & off).sum()} do both. Only {(like_sac & off).sum()} of {off.sum()} are as",
    ]


def test_the_counts_of_agents_on_rewards_of_several_targets_are_the_archives(checkout: Path) -> None:
    text = " ".join((checkout / "docs" / "findings.md").read_text(encoding="utf-8").split())
    said = of_several_targets(checkout / "results" / "reference")
    assert [words for words in said if words not in text] == []
    for right, wrong in (("25 agents 16", "25 agents 17"), ("57 of 100", "58 of 100"), ("Only 14", "Only 15")):
        assert any(words not in text.replace(right, wrong) for words in said)
