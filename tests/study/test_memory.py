"""The plan's memory, held against what `python -m benchmarks.memory` measured."""

import pytest
from benchmarks.memory import planned

from mtcsirl.settings import Settings
from mtcsirl.settings.loading import load
from mtcsirl.study.design import design
from mtcsirl.study.memory import irl_memory
from mtcsirl.study.plan import cost, request
from mtcsirl.study.rates import load_rates

MEASURED = {
    "desk-irl-1": (617, 618),
    "desk-irl-3": (831, None),
    "desk-irl-6": (1308, None),
    "desk-irl-30": (4266, None),
    "paper-irl-1": (672, None),
    "paper-irl-5": (1283, 961),
    "paper-irl-30": (4260, 2342),
    "desk-agents-1": (471, None),
    "desk-agents-16": (1199, None),
    "paper-agents-1": (610, None),
    "paper-agents-16": (3369, None),
}
"""MiB of a run, and of a score of what it leaves (docs/performance.md)."""


@pytest.mark.parametrize("case", MEASURED)
def test_the_plan_is_within_15_percent_of_what_was_measured(case: str) -> None:
    for part, measured in zip(("run", "scored"), MEASURED[case], strict=True):
        if measured is not None:
            assert planned(case)[part] == pytest.approx(measured, rel=0.15), part


def test_more_generators_longer_memories_and_larger_networks_take_more() -> None:
    run = next(one for one in design(Settings()).irl_runs if len(one.members) == 6)
    own = run.settings(Settings())
    least = irl_memory(own, 6)
    assert irl_memory(own, 7) > least
    for part in ({"sac": {"hidden_sizes": [512, 512]}}, {"sac": {"critics": 5}}):
        larger = Settings.model_validate(part)
        assert irl_memory(run.settings(larger), 6) > least, part


def test_a_run_asks_for_more_than_it_needs_and_for_more_on_a_retry() -> None:
    settings, rates = load(scale="paper"), load_rates()
    for run in design(settings):
        need = cost(run, settings, rates)
        first, second = (request(run, settings, rates, attempt) for attempt in (1, 2))
        assert first.mem_mb * 1e6 > 1.2 * need.memory_mib * 2**20
        assert second.mem_mb > 1.4 * first.mem_mb
        assert 60 * first.minutes > 2 * need.seconds
        assert second.minutes > first.minutes
