"""Numbers of the reference study in the README and in findings are the archive's."""

import json
import re
from collections.abc import Mapping
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
UNSEEN_TASKS = ("reach-wall", "button-press-topdown-wall", "drawer-close", "push-back")
UNSEEN = {f"unseen {task}": f"transfer/multi_task/mt_csirl/{{metric}}/all/{task}-t0" for task in UNSEEN_TASKS}
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


def table_rows(text: str, without: str = " ") -> list[list[str]]:
    """The cells of each row of the tables in a page, stripped of the characters ``without``."""
    rows = [line.strip("|").split("|") for line in text.splitlines() if line[:2] == "| "]
    return [[cell.strip(without) for cell in row] for row in rows]


def cells(text: str) -> dict[str, list[str]]:
    """The rows on unseen tasks and on one task by their first cell, without marks."""
    return {first: rest for first, *rest in table_rows(text, " †") if first in ALONE | UNSEEN}


def correlations(text: str) -> dict[str, list[str]]:
    """The rows of the correlations by their first cell, without the paper's and marks."""
    return {first: rest[:2] for first, *rest in table_rows(text, " †") if first in CORRELATIONS}


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


@pytest.fixture
def pages(checkout: Path) -> tuple[str, str]:
    """The README, and findings behind it."""
    readme, findings = (checkout / page for page in ("README.md", "docs/findings.md"))
    return readme.read_text(encoding="utf-8"), findings.read_text(encoding="utf-8")


def test_the_tables_say_what_the_archive_says(checkout: Path, pages: tuple[str, str]) -> None:
    archive = checkout / "results" / "reference"
    assert cells(pages[1]) == from_archive(archive)
    assert correlations(pages[1]) == correlations_from_archive(archive)
    assert f"{len(archived(archive))} of its 1,111 runs" in pages[0]


@pytest.mark.parametrize("changed", [("0.82 [", "0.83 ["), ("| 0.96 |", "| 1.00 |"), ("| 0.28 |", "| 0.38 |")])
def test_a_changed_number_is_noticed(checkout: Path, pages: tuple[str, str], changed: tuple[str, str]) -> None:
    assert cells(pages[1].replace(*changed, 1)) != from_archive(checkout / "results" / "reference")


@pytest.mark.parametrize("changed", [("0.27 [0.00", "0.87 [0.00"), ("[0.22, 0.48]", "[0.23, 0.48]")])
def test_a_changed_correlation_is_noticed(checkout: Path, pages: tuple[str, str], changed: tuple[str, str]) -> None:
    assert correlations(pages[1].replace(*changed, 1)) != correlations_from_archive(checkout / "results" / "reference")


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


METHODS = {
    "Expert": "expert/{metric}/{task}-t0",
    "SAC": "sac/{task}-t0",
    "MT-AIRL": "transfer/multi_task/mt_airl/{metric}/all/{task}-t0",
    "MT-VAIRL": "transfer/multi_task/mt_vairl/{metric}/all/{task}-t0",
    "MT-VAIRL-GP": "transfer/multi_task/mt_vairl_gp/{metric}/all/{task}-t0",
    "MT-CSIRL": "transfer/multi_task/mt_csirl/{metric}/all/{task}-t0",
    "MT-CSIRL+LT": "transfer/multi_task/mt_csirl_lt/{metric}/all/{task}-t0",
}
"""The rows of Table 2 and the folders of their agents."""


def successes(archive: Path) -> str:
    """What the README must say of the success of new agents on unseen tasks."""
    rows = from_archive(archive)
    said = [f"{rows[f'unseen {task}'][1]} and {rows[f'unseen {task}'][3]} on {task}" for task in UNSEEN_TASKS]
    return f"Success is {', '.join(said)}"


def test_the_shares_of_successes_are_the_archives(checkout: Path) -> None:
    text = " ".join((checkout / "README.md").read_text(encoding="utf-8").split())
    assert successes(checkout / "results" / "reference") in text
    assert successes(checkout / "results" / "reference") not in text.replace("0.68 and 0.10", "0.99 and 1.00")


def table_2(text: str) -> dict[str, list[str]]:
    """Ours in each row of the README's Table 2, without the paper's: metric and success, twice."""
    return {first: rest[::2] for first, *rest in table_rows(text) if first in METHODS and len(rest) == 8}


def below_their_gate(archive: Path) -> pd.Series:
    """Whether a run's gate failed, by folder."""
    texts = read(archive, "texts").query("file == 'gate.json'").set_index("folder")["content"]
    return ~texts.map(lambda content: json.loads(content)["passed"]).astype(bool)


def table_2_from_archive(archive: Path) -> dict[str, list[str]]:
    """Mean over seeds of the means over unseen tasks, their standard deviation and how many agents fail their gate; a
    dash if a task lacks seeds."""
    means, failed, found = agents_of(archive), below_their_gate(archive), {}
    for name, pattern in METHODS.items():
        found[name] = ["–"] * 4
        for column, metric in ((0, "velocity"), (2, "action_norm")):
            folders = [
                [f"{pattern.format(metric=metric, task=task)}/s{seed}" for task in UNSEEN_TASKS] for seed in range(5)
            ]
            if {folder for seed in folders for folder in seed} <= set(means.index):
                seeds = pd.DataFrame([means.loc[seed].mean() for seed in folders])
                below = sum(failed[folder] for seed in folders for folder in seed)
                mark = f" †{below}" if below else ""
                found[name][column] = f"{seeds[metric].mean():.2f} ± {seeds[metric].std():.2f}{mark}"
                found[name][column + 1] = f"{100 * seeds['success'].mean():.1f}"
    return found


def test_its_table_2_is_the_archives(checkout: Path) -> None:
    text = (checkout / "README.md").read_text(encoding="utf-8")
    archive = checkout / "results" / "reference"
    assert table_2(text) == table_2_from_archive(archive)
    for changed in (("| 42.0 |", "| 99.2 |"), ("†12", "†2")):
        assert table_2(text.replace(*changed)) != table_2_from_archive(archive), "a changed one is noticed"


def marked(text: str) -> set[str]:
    """The units of C3 that findings mark as not judged, as the results page names them."""
    cells = {first.removesuffix(" alone"): rest for first, *rest in table_rows(text) if first in ALONE}
    names = {"velocity": 1, "action norm": 3}
    return {f"{name}, {task}" for task, rest in cells.items() for name, column in names.items() if "†" in rest[column]}


def not_judged(page: str) -> set[str]:
    """The units of C3 whose precondition is not met, from the results page."""
    section = page.partition("### C3:")[2].partition("### C4:")[0]
    return set(re.findall(r"^\| ([^|]+) \| precondition not met \|", section, re.MULTILINE))


def test_findings_mark_the_units_that_are_not_judged(checkout: Path) -> None:
    text = (checkout / "docs" / "findings.md").read_text(encoding="utf-8")
    page = (checkout / "docs" / "results.md").read_text(encoding="utf-8")
    assert marked(text) == not_judged(page) != set()
    assert marked(text.replace("| 0.86 † |", "| 0.86 |", 1)) != not_judged(page), "a lost mark is noticed"


def of_new_agents(archive: Path, patterns: Mapping[str, str]) -> pd.DataFrame:
    """Of each new agent: its task, whether it is within 25 % of the target, and whether it keeps its task."""
    means, found = agents_of(archive), []
    for metric, target in (("velocity", 0.8), ("action_norm", 3.0)):
        for name, pattern in patterns.items():
            own = means[means.index.str.fullmatch(re.escape(pattern.format(metric=metric)) + r"/s\d+")]
            near = (own[metric] - target).abs() <= 0.25 * target
            found.append(pd.DataFrame({"on": name, "near": near, "kept": own["success"] >= 0.9}))
    return pd.concat(found)


def counted(archive: Path) -> list[str]:
    """What the README must count of new agents on one task's rewards, and on six tasks' rewards on unseen tasks."""
    one, six = of_new_agents(archive, ALONE), of_new_agents(archive, UNSEEN)
    close = int(six[six["on"] == "unseen drawer-close"]["kept"].sum())
    behave, six_behave = (f"{agents['near'].sum()} of {len(agents)}" for agents in (one, six))
    return [
        f"So far {behave} new agents get the behaviour from one task's reward. Of {len(six)} on unseen tasks,",
        f"rewards, {six_behave.partition(' ')[0]} get it and {(~six['kept']).sum()} lose the task.",
        f"{behave} have the behaviour, and {(one['near'] & one['kept']).sum()} of {len(one)} the task too",
        f"Of {len(six)} on MT-CSIRL's f {six['kept'].sum()} keep their task, {close} of them on drawer-close.",
    ]


@pytest.mark.parametrize("wrong", [("36 of 50", "46 of 50"), ("27 lose", "28 lose"), ("13 keep", "10 keep")])
def test_the_counts_of_new_agents_are_the_archives(checkout: Path, wrong: tuple[str, str]) -> None:
    text = " ".join((checkout / "README.md").read_text(encoding="utf-8").split())
    said = counted(checkout / "results" / "reference")
    assert [words for words in said if words not in text] == []
    assert any(words not in text.replace(*wrong) for words in said), "a changed one is noticed"


def correlations_in_words(archive: Path) -> str:
    """What the README must say of r on SAC's transitions of reach-wall, and of r of -r_task alone there."""
    one, _, six, norm = (row[0].partition(" ")[0] for row in correlations_from_archive(archive).values())
    scores = read(archive, "scores").query("statistic == 'pearson' and reward == 'minus_task' and transitions == 'sac'")
    alone = scores[scores["folder"].str.startswith(CORRELATIONS["one task, velocity"])]["value"]
    return (
        f"velocity's r is {one}, the paper's 0.18, but -r_task alone has {mean_correlation(alone).value:.2f}; "
        f"of six tasks' f it is {six}, the norm's {norm}, the paper's 0.88 and 0.86"
    )


def test_its_correlations_are_the_archives(checkout: Path) -> None:
    text = " ".join((checkout / "README.md").read_text(encoding="utf-8").split())
    said = correlations_in_words(checkout / "results" / "reference")
    assert said in text
    assert said not in text.replace("alone has 0.76", "alone has 0.36")


def of_several_targets(archive: Path) -> tuple[list[str], str]:
    """What findings and README count of the agents on rewards of several targets, on their own task and off it."""
    means = agents_of(archive)
    at_home, counts = [], []
    for metric, target in (("velocity", 0.8), ("action_norm", 3.0)):
        named = rf"transfer/multi_target/mt_csirl/{metric}/(?P<source>[\w-]+)/(?P<task>[\w-]+)-t0/s\d+"
        key = means.index.to_series().str.extract(f"^{named}$").dropna()
        sac = means[metric][means.index.str.startswith("sac/")]
        usual = sac.groupby(sac.index.str.extract(r"sac/([\w-]+)-t0", expand=False)).mean()
        own, base = means.loc[key.index], key["task"].map(usual)
        near, kept = (own[metric] - target).abs() <= 0.25 * target, own["success"] >= 0.9
        like_sac = ((own[metric] - base).abs() < 0.25 * (target - base)) & kept
        off = key["source"] != key["task"]
        assert ((~off).sum(), off.sum()) == (25, 100)
        at_home.append((near & kept & ~off).sum())
        counts.append([(what & off).sum() for what in (near, kept, near & kept, like_sac)])
    return [
        f"{at_home[0]} of the velocity's 25 agents and {at_home[1]} of the norm's 25 succeed in at least 90 %",
        *(f" | {velocity} | {norm} | " for velocity, norm in zip(*counts, strict=True)),
        f"of 200 agents elsewhere {counts[0][2] + counts[1][2]} have both",
    ], "{} have the behaviour, {} keep the task, {} do both; {} are".format(*map(sum, zip(*counts, strict=True)))


def test_the_counts_of_agents_on_rewards_of_several_targets_are_the_archives(
    checkout: Path, pages: tuple[str, str]
) -> None:
    readme, text = (" ".join(page.split()) for page in pages)
    counts, in_readme = of_several_targets(checkout / "results" / "reference")
    assert in_readme in readme
    assert [words for words in counts if words not in text] == []
    for right, wrong in (
        ("16 of the", "17 of the"),
        ("| 57 |", "| 58 |"),
        ("| 5 |", "| 6 |"),
        (" 29 have", " 30 have"),
    ):
        assert any(words not in text.replace(right, wrong) for words in counts)
