"""What runs have taken against what the plan says of them, stage by stage."""

from collections import defaultdict
from collections.abc import Iterable
from statistics import quantiles
from typing import NamedTuple

from mtcsirl.settings import Settings
from mtcsirl.study.plan import cost
from mtcsirl.study.rates import Rates
from mtcsirl.study.readings import provenance_of
from mtcsirl.study.runs import AnyRun
from mtcsirl.study.standing import DONE, standing

ALONE, LOCKSTEP = "alone", "in lockstep"


class Spent(NamedTuple):
    """Done runs of one stage that were made the same way: CPU seconds of a run, start-up aside."""

    stage: str
    made: str
    processor: str
    runs: int
    planned: float
    measured: float
    low: float
    high: float
    """Measured over planned: the 5 % and 95 % quantiles over runs."""

    @property
    def ratio(self) -> float:
        """Measured over planned, of all runs together."""
        return self.measured / self.planned


def spent(study: Iterable[AnyRun], settings: Settings, rates: Rates, cores: int = 1) -> list[Spent]:
    """One line per stage, way and processor, of the runs that are done, in the DAG's order.

    ``cores``: how many of them ran at once; where it was more than one, the plan's seconds are those of busy cores.

    Raises:
        UserError: the provenance of a run is unreadable, or lacks what is asked for.
    """
    slowdown = rates.slowdown if cores > 1 else 1.0
    pairs: dict[tuple[str, str, str], list[tuple[float, float]]] = defaultdict(list)
    for run in study:
        if standing(run, settings).state != DONE:
            continue
        said = provenance_of(run, settings)
        others = len(said.parts("lockstep"))
        together, made = others or 1, LOCKSTEP if others else ALONE
        planned = slowdown * (cost(run, settings, rates, together).seconds - rates.start_up / together)
        measured = said.number("cost", "cpu_seconds")
        pairs[run.stage, made, said.text("machine", "processor")].append((planned, measured))
    return [_of(*key, own) for key, own in pairs.items()]


def _of(stage: str, made: str, processor: str, pairs: list[tuple[float, float]]) -> Spent:
    planned, measured = (sum(column) / len(pairs) for column in zip(*pairs, strict=True))
    ratios = [took / said for said, took in pairs]
    low, *_, high = quantiles(ratios, n=20, method="inclusive") if len(ratios) > 1 else ratios * 2
    return Spent(stage, made, processor, len(pairs), planned, measured, low, high)
