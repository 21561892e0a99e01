"""How often each test of the claims is right: coverage, errors and power at five seeds, in made-up studies.

    python -m benchmarks.statistics_power      four minutes; writes statistics_power.json and prints a table

The model of every row: values of seeds are normal, n = 5 per group, groups independent unless the row says otherwise.
Distances are in units of SAC's gap, so that an agent at distance 0.15 closes 85 % of it. Coverage: share of studies
whose nominal 95 % interval holds the truth. Error: share that is called "met" with the truth exactly on the limit,
nominal 5 %. Power: share that is called "met" where the claim is true.
"""

import argparse
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from mtcsirl.claims.groups import at_least_by_chance
from mtcsirl.claims.judging import MET, at_least, at_most, closing, staying_below, surely
from mtcsirl.files.storage import write_json
from mtcsirl.results.contrasts import fieller, nearness
from mtcsirl.results.moments import beyond_task
from mtcsirl.results.statistics import (
    Array,
    Summary,
    contrast,
    hedges_g,
    mean_correlation,
    prediction_interval,
    summarise,
    t_interval,
    welch,
)

FILE = Path(__file__).with_name("statistics_power.json")
SEEDS, STUDIES, SCORED = 5, 4000, 1000
Draw = Callable[[np.random.Generator], bool]
"""One study: whether its interval holds the truth, or whether it is called "met"."""


def _normal(generator: np.random.Generator, mean: float, spread: float) -> Summary:
    return summarise(generator.normal(mean, spread, SEEDS))


def coverages() -> Iterator[tuple[str, str, Draw]]:
    """(test, model, draw) of every interval."""
    yield "t-interval", "one group", lambda g: t_interval(_normal(g, 0.0, 1.0)).contains(0.0)
    yield (
        "prediction interval", "another five seeds",
        lambda g: prediction_interval(_normal(g, 0.0, 1.0), SEEDS).contains(_normal(g, 0.0, 1.0).mean),
    )  # fmt: skip
    for spread in (1.0, 3.0):

        def difference(g: np.random.Generator, spread: float = spread) -> bool:
            test = welch(_normal(g, 0.0, 1.0), _normal(g, 0.0, spread))
            return test.low <= 0 <= test.high

        yield "Welch", f"spreads 1 and {spread:g}", difference

    def three_groups(g: np.random.Generator) -> bool:
        test = contrast((1.0, _normal(g, 0.6, 0.3)), (-1.0, _normal(g, 0.1, 0.1)), (-0.1, _normal(g, 1.0, 0.1)))
        return test.low <= 0.4 <= test.high

    yield "contrast of three groups (C8)", "spreads 0.3, 0.1, 0.1", three_groups

    def paired(g: np.random.Generator) -> bool:
        common = g.normal(0.0, 1.0, SEEDS)
        first, second = (common + g.normal(mean, 0.2, SEEDS) for mean in (0.5, 0.0))
        return t_interval(summarise(first - second)).contains(0.5)

    yield "paired t (C6, C13)", "common spread 1, own 0.2", paired
    for spread in (0.1, 0.3):

        def ratio(g: np.random.Generator, spread: float = spread) -> bool:
            found = fieller(_normal(g, 0.2, spread), _normal(g, 1.0, spread))
            return found.low <= 0.2 <= found.high

        yield "Fieller's set (part of the gap)", f"ratio 0.2, spreads {spread:g}", ratio

    def effect(g: np.random.Generator) -> bool:
        found, correction = hedges_g(_normal(g, 2.0, 1.0), _normal(g, 0.0, 1.0)), 1 - 3 / 31
        return found.low <= 2.0 * correction <= found.high

    yield "Hedges' g", "true effect 2", effect

    def over_seeds(g: np.random.Generator) -> bool:
        found = mean_correlation(np.tanh(g.normal(0.8, 0.3, SEEDS)))
        return found.low <= np.tanh(0.8) <= found.high

    yield "r over seeds", "Fisher z 0.8, spread 0.3", over_seeds


def errors() -> Iterator[tuple[str, str, Draw]]:
    """(test, model, draw) of everything that can be met, with the truth on the limit."""
    yield (
        "at most (C1, C2, C11)",
        "spread 0.05, limit 0.15",
        lambda g: at_most(_normal(g, 0.15, 0.05), 0.15, "")[0] == MET,
    )
    yield "at least (success)", "10 episodes, success 90 %, limit 90 %", lambda g: _succeeds(g, 0.9)
    for spread in (0.05, 0.1, 0.2):
        yield (
            "equivalence (C3)", f"spreads {spread:g} of the gap, difference 25 %",
            lambda g, s=spread: nearness(_normal(g, 0.25, s), _normal(g, 0.0, s), 1.0, 0.25).inside,
        )  # fmt: skip
    yield (
        "closes 50 % (C5, C7, C10)", "spreads 0.2",
        lambda g: closing(_normal(g, 0.5, 0.2), _normal(g, 1.0, 0.2), 0.5)[0] == MET,
    )  # fmt: skip
    yield (
        "closes at most 25 % (C6)", "spreads 0.2",
        lambda g: staying_below(_normal(g, 0.75, 0.2), _normal(g, 1.0, 0.2), 0.25)[0] == MET,
    )  # fmt: skip
    yield "lead of 10 % (C8, C13)", "spreads 0.2", lambda g: _leads(g, 0.1, 0.2)


def powers() -> Iterator[tuple[str, str, Draw]]:
    """(test, model, draw) of claims that are true as the paper says."""
    for spread in (0.05, 0.1, 0.15, 0.2, 0.24):
        yield (
            "equivalence (C3)", f"no difference, spreads {spread:g} of the gap",
            lambda g, s=spread: nearness(_normal(g, 0.0, s), _normal(g, 0.0, s), 1.0, 0.25).inside,
        )  # fmt: skip
    for spread in (0.1, 0.2, 0.3):
        yield (
            "closes 50 % (C5, C7, C10)", f"closes 85 %, spreads {spread:g}",
            lambda g, s=spread: closing(_normal(g, 0.15, s), _normal(g, 1.0, s), 0.5)[0] == MET,
        )  # fmt: skip
    for spread in (0.1, 0.2, 0.3):
        yield (
            "closes at most 25 % (C6)", f"closes 5 %, spreads {spread:g}",
            lambda g, s=spread: staying_below(_normal(g, 0.95, s), _normal(g, 1.0, s), 0.25)[0] == MET,
        )  # fmt: skip
    for spread in (0.2, 0.4):
        yield "lead of 10 % (C8, C13)", f"leads by 60 %, spreads {spread:g}", lambda g, s=spread: _leads(g, 0.6, s)
    for share in (0.95, 0.99):
        yield (
            "at least (success)", f"10 episodes, success {100 * share:g} %, limit 90 %",
            lambda g, p=share: _succeeds(g, p),
        )  # fmt: skip


def _succeeds(generator: np.random.Generator, share: float) -> bool:
    found = at_least_by_chance(summarise(generator.binomial(10, share, SEEDS) / 10), 10)
    return at_least(found, 0.9, "")[0] == MET


def _leads(generator: np.random.Generator, lead: float, spread: float) -> bool:
    ours, theirs = _normal(generator, 0.2, spread), _normal(generator, 0.2 + lead, spread)
    return surely("", (1.0, theirs), (-1.0, ours), (-0.1, _normal(generator, 1.0, spread)))[0] == MET


# --- partial correlations: transitions of agents and episodes instead of one number per seed ---


def scored_study(
    generator: np.random.Generator, spread: float, shared: float, seeds: int = SEEDS, agents: int = 5, episodes: int = 2
) -> pd.DataFrame:
    """Points of f = b_k c + t + offsets + noise; c and t have offsets of agents and episodes as well.

    ``spread``: of b_k over IRL seeds about 0.6; ``shared``: of the agents' offsets, which SAC and the experts bring to
    every IRL seed; offsets of episodes have 0.3.
    """
    sets = [
        (name, a)
        for name, n in (("sac", agents), ("expert", agents), ("generator", 1), ("uniform", 1))
        for a in range(n)
    ]
    own = {one: generator.normal(0.0, shared, 3) for one in sets}
    steps, parts = 40, []
    for seed in range(seeds):
        slope = 0.6 + spread * generator.normal()
        offsets = np.array(
            [own[one] if one[0] in ("sac", "expert") else generator.normal(0.0, shared, 3) for one in sets]
        )
        shift = np.repeat(offsets, episodes, axis=0) + generator.normal(0.0, 0.3, (len(sets) * episodes, 3))
        of_f, of_c, of_t = np.repeat(shift, steps, axis=0).T
        noise = generator.normal(size=(3, len(of_f)))
        truth = of_c + noise[0]
        task = of_t + 0.5 * truth + noise[1]
        label = np.repeat(np.arange(len(sets)), episodes * steps)
        parts.append(
            pd.DataFrame(
                {
                    "seed": seed,
                    "transitions": np.array([name for name, _ in sets])[label],
                    "agent": np.array([agent for _, agent in sets])[label],
                    "episode": np.repeat(np.arange(len(sets) * episodes), steps),
                    "truth": truth,
                    "learned": slope * truth + task + of_f + noise[2],
                    "task_reward": task,
                }
            )
        )
    return pd.concat(parts, ignore_index=True)


def scored_coverages(studies: int) -> Iterator[dict[str, Any]]:
    """Coverage of the partial correlation's interval; the truth is that of many IRL seeds, agents and episodes."""
    for number, (spread, shared) in enumerate(((0.3, 0.3), (0.1, 0.3), (0.3, 0.6))):
        generator = np.random.default_rng([number, 3])
        large = [
            beyond_task(scored_study(generator, spread, shared, 20, 20, 6), generator, resamples=2).partial.value
            for _ in range(20)
        ]
        truth = float(np.tanh(np.arctanh(large).mean()))
        found = [
            beyond_task(scored_study(generator, spread, shared), generator, resamples=200).partial
            for _ in range(studies)
        ]
        model = f"IRL seeds spread {spread:g}, shared agents {shared:g}, episodes 0.3"
        yield _row("coverage", "partial r (C4, C9)", model, [one.low <= truth <= one.high for one in found])


def _row(kind: str, test: str, model: str, hits: list[bool] | Array) -> dict[str, Any]:
    return {
        "kind": kind,
        "test": test,
        "model": model,
        "n": SEEDS,
        "studies": len(hits),
        "share": round(float(np.mean(hits)), 4),
    }


def simulate(kind: str, number: int, test: str, model: str, draw: Draw, studies: int = STUDIES) -> dict[str, Any]:
    """One row; ``kind`` and ``number`` decide its random numbers."""
    generator = np.random.default_rng([number, ("coverage", "error", "power").index(kind)])
    return _row(kind, test, model, [bool(draw(generator)) for _ in range(studies)])


def rows() -> Iterator[dict[str, Any]]:
    """Every row but those of partial correlations."""
    for kind, cases in (("coverage", coverages), ("error", errors), ("power", powers)):
        for number, (test, model, draw) in enumerate(cases()):
            yield simulate(kind, number, test, model, draw)


def table(found: list[dict[str, Any]]) -> str:
    """The rows as Markdown."""
    lines = ["| | test | model | share of studies |", "|---|---|---|---|"]
    lines += [f"| {row['kind']} | {row['test']} | {row['model']} | {100 * row['share']:.1f} % |" for row in found]
    return "\n".join(lines)


def main() -> None:
    """Simulate, print, write."""
    argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter).parse_args()
    plain = list(rows())
    found = sorted(
        [*plain, *scored_coverages(SCORED)], key=lambda row: ("coverage", "error", "power").index(row["kind"])
    )
    write_json(FILE, {"rows": found})
    print(table(found))


if __name__ == "__main__":
    main()
