"""What an update costs with either library that multiplies: CPU milliseconds per agent, least of several turns.

    python -m benchmarks.products

OPENBLAS_CORETYPE, where it is set, decides which kernels numpy takes; the first line names it.
"""

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import torch

from benchmarks.sides import seconds
from mtcsirl.agents import products
from mtcsirl.agents.sac import FusedSac
from mtcsirl.files.provenance import machine
from mtcsirl.settings.loading import load
from mtcsirl.settings.runs import baseline_run

UPDATES, PARTS, TURNS = 40, 6, 3


def milliseconds(agents: int) -> float:
    """CPU time of an update per agent, least of some parts of a turn."""
    settings = baseline_run(load(), "reach").sac
    learner, b = FusedSac(agents, settings, seeds=range(agents)), settings.minibatch
    batch = torch.randn(agents, b, 39), torch.rand(agents, b, 4), torch.randn(agents, b), torch.randn(agents, b, 39)
    count, found = max(1, UPDATES // agents), []
    for _ in range(PARTS + 1):  # the first warms up
        found.append(seconds(lambda: learner.update(*batch), count))
    return 1000 * min(found[1:]) / agents


def main() -> None:
    """Measure both in alternation and print."""
    torch.set_num_threads(1)
    print(f"{machine()['processor']}; OpenBLAS: {machine()['openblas']}; as shipped: {_name(products.BY_NUMPY)}")
    for agents in (1, 6):
        turns: dict[bool, list[float]] = {True: [], False: []}
        for _ in range(TURNS):
            for products.BY_NUMPY in turns:
                turns[products.BY_NUMPY].append(milliseconds(agents))
        least = {_name(library): min(of) for library, of in turns.items()}
        print(f"{agents} agents: " + ", ".join(f"{name} {value:.2f} ms" for name, value in least.items()))


def _name(by_numpy: bool) -> str:
    return "numpy" if by_numpy else "torch"


if __name__ == "__main__":
    main()
